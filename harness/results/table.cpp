#include "harness/results/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

namespace raybench {
namespace {

std::string Text(const Json& row, const char* column) {
  return row.at(column).is_string() ? row.at(column).get<std::string>() : std::string();
}
std::optional<double> Number(const Json& row, const char* column) {
  if (!row.at(column).is_number()) return std::nullopt;
  return row.at(column).get<double>();
}

/// All cases of one tree.
using Rows = std::vector<const Json*>;

std::string Verdict(const Rows& rows) {
  static constexpr const char* kPlainErrors[] = {"leak", "wrong", "false_miss", "false_hit"};
  double verified = 0;
  std::map<std::string, double> errors;
  std::string claim;
  bool skipped = true;
  for (const Json* row : rows) {
    const std::string status = Text(*row, "status");
    if (status == "refused") return "REFUSED";
    if (status == "skipped") continue;
    skipped = false;
    claim = Text(*row, "claim");
    verified += Number(*row, "verified").value_or(0);
    for (const char* e : kPlainErrors) errors[e] += Number(*row, e).value_or(0);
  }
  if (skipped) return "skipped";
  if (claim == "nothing") return "claims nothing";
  std::string text;
  for (const char* e : kPlainErrors) {
    if (errors[e] > 0) {
      text += fmt::format("{}{} {} %", text.empty() ? "" : ", ", e, FormatFigure(100 * errors[e] / verified));
    }
  }
  if (verified == 0) return claim + ", not verified";
  if (claim == "inexact") return text.empty() ? "inexact, no error seen" : text;
  return claim + " ok";
}

std::string Rate(const Json& row) {
  const auto rate = Number(row, "rate");
  return rate ? FormatFigure(*rate * 1e-6) : "-";
}

/// A counter per ray, over all closest-hit rays of one tree.
std::string PerRay(const Rows& rows, const char* counter) {
  double sum = 0, rays = 0;
  for (const Json* row : rows) {
    const auto value = Number(*row, counter);
    if (!value || Text(*row, "query") != "closest") continue;
    sum += *value * *Number(*row, "rays"), rays += *Number(*row, "rays");
  }
  return rays > 0 ? FormatFigure(sum / rays) : "-";
}

std::string ColumnName(const Json& row, bool show_threads) {
  std::string name = Text(row, "ray_set");
  if (Text(row, "order") == "shuffled") name += "~";
  if (show_threads) name += fmt::format(" x{}", row.at("threads").get<uint32_t>());
  return name;
}

/// Which parts of the ray sets were timed, in words; empty if always all of them.
std::string TimedParts(const Rows& scene) {
  uint64_t cases = 0, parts = 0;
  double smallest = 1;
  for (const Json* row : scene) {
    const auto timed = Number(*row, "timed_rays"), rays = Number(*row, "rays");
    if (!timed || !rays) continue;
    ++cases;
    if (*timed == *rays) continue;
    ++parts;
    smallest = std::min(smallest, *timed / *rays);
  }
  if (parts == 0) return {};
  return fmt::format(
      "  {} of {} timed on a part of the rays to stay within the budget, 1/{:.0f} at least: timed_rays\n",
      parts, cases, 1 / smallest);
}

std::string FormatScene(const Rows& scene) {
  std::vector<std::string> specs, sets, builds;
  std::map<std::string, Rows> by_spec;
  std::map<std::pair<std::string, std::string>, const Json*> at;  // (spec, column) -> row
  std::vector<std::pair<std::string, std::string>> notes;
  bool many_threads = false, shuffled = false;
  for (const Json* row : scene) {
    if (Text(*row, "query") != "build" && row->at("threads") != scene.back()->at("threads"))
      many_threads = true;
    shuffled |= Text(*row, "order") == "shuffled";
  }
  const auto add = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const Json* row : scene) {
    const std::string spec = Text(*row, "spec");
    const bool build = Text(*row, "query") == "build";
    const std::string column = ColumnName(*row, build || many_threads);
    add(specs, spec);
    add(build ? builds : sets, column);
    by_spec[spec].push_back(row);
    at[{spec, column}] = row;
    const std::pair note(spec, Text(*row, "note"));
    if (!note.second.empty() && std::find(notes.begin(), notes.end(), note) == notes.end())
      notes.push_back(note);
  }

  const Json& first = *scene.front();
  std::string text =
      fmt::format("{}: {} primitives\n\n", Text(first, "scene"), first.at("primitives").get<uint64_t>());
  std::vector<std::string> header = {"structure", "verdict"};
  for (const std::string& build : builds) header.push_back(build + " ms");
  for (const char* name : {"steps/ray", "prims/ray", "MiB"}) header.push_back(name);
  Grid properties(header);
  for (const std::string& spec : specs) {
    const Rows& rows = by_spec[spec];
    const Json& own = *rows.front();
    std::vector<std::string> cells = {spec, Verdict(rows)};
    for (const std::string& build : builds) {
      const auto found = at.find({spec, build});
      const auto ns = found == at.end() ? std::nullopt : Number(*found->second, "median_ns");
      cells.push_back(ns ? FormatFigure(*ns * 1e-6) : "-");
    }
    cells.push_back(PerRay(rows, "steps"));
    cells.push_back(PerRay(rows, "prims"));
    const auto nodes = Number(own, "node_bytes");
    cells.push_back(nodes ? FormatFigure((*nodes + *Number(own, "prim_bytes")) / (1 << 20)) : "-");
    properties.Add(cells);
  }
  text += properties.Format(2);

  if (!sets.empty()) {
    std::string anchor;
    for (const Json* row : scene)
      if (anchor.empty()) anchor = Text(*row, "anchor");
    text += fmt::format(
        "\n  Mrays/s{}{}\n",
        anchor.empty() ? "" : fmt::format(", in brackets as a multiple of {} on the same rays", anchor),
        shuffled ? "; ~ shuffled" : "");
    header = {"structure"};
    header.insert(header.end(), sets.begin(), sets.end());
    Grid rates(header);
    for (const std::string& spec : specs) {
      std::vector<std::string> cells = {spec};
      for (const std::string& set : sets) {
        const auto found = at.find({spec, set});
        std::string cell = found == at.end() ? "-" : Rate(*found->second);
        if (cell != "-" && spec != anchor && Text(*found->second, "claim") != "nothing") {
          const auto own = Number(*found->second, "median_ns"), base = Number(*found->second, "anchor_ns");
          if (own && base) cell += fmt::format(" ({:.{}f})", *base / *own, *base < 0.01 * *own ? 4 : 2);
        }
        cells.push_back(cell);
      }
      rates.Add(cells);
    }
    text += rates.Format(1) + TimedParts(scene);
  }
  for (const auto& [spec, note] : notes) text += fmt::format("  {}: {}\n", spec, note);
  return text + "\n";
}

}  // namespace

void Grid::Add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }

std::string Grid::Format(size_t left_columns, size_t width_limit) const {
  const size_t columns = rows_[0].size();
  std::vector<size_t> width(columns, 0);
  for (const auto& row : rows_) {
    for (size_t c = 0; c < columns; ++c) width[c] = std::max(width[c], row[c].size());
  }
  std::string text;
  for (size_t begin = 1; begin < columns;) {
    size_t end = begin, total = 2 + width[0];
    while (end < columns && (end == begin || total + 2 + width[end] <= width_limit))
      total += 2 + width[end++];
    for (const auto& row : rows_) {
      std::string line = fmt::format("  {:<{}}", row[0], width[0]);
      for (size_t c = begin; c < end; ++c) {
        line += c < left_columns ? fmt::format("  {:<{}}", row[c], width[c])
                                 : fmt::format("  {:>{}}", row[c], width[c]);
      }
      line.erase(line.find_last_not_of(' ') + 1);
      text += line + "\n";
    }
    begin = end;
    if (begin < columns) text += "\n";
  }
  return text;
}

std::string FormatFigure(double value) {
  if (value == 0 || !std::isfinite(value)) return fmt::format("{}", value);
  const int digits = 2 - int(std::floor(std::log10(std::fabs(value))));
  if (digits > 6) return fmt::format("{:.1e}", value);
  return fmt::format("{:.{}f}", value, std::max(0, digits));
}

std::string FormatTable(std::span<const Json> cases) {
  std::vector<std::string> order;
  std::map<std::string, Rows> scenes;
  for (const Json& file : cases) {
    const std::string scene = Text(file.at("case"), "scene");
    if (!scenes.contains(scene)) order.push_back(scene);
    scenes[scene].push_back(&file.at("case"));
  }
  std::string text;
  for (const std::string& scene : order) text += FormatScene(scenes[scene]);
  return text;
}

}  // namespace raybench
