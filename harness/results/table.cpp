#include "harness/results/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

namespace raybench {
namespace {

/// All cases of one tree.
using Rows = std::vector<const Row*>;

std::string Verdict(const Rows& rows) {
  static constexpr ColumnOf<ColumnType::kCount> kPlainErrors[] = {column::leak, column::wrong,
                                                                  column::false_miss, column::false_hit};
  double verified = 0, errors[std::size(kPlainErrors)] = {};
  std::string claim;
  bool skipped = true;
  for (const Row* row : rows) {
    const std::string status = row->Get(column::status);
    if (status == "refused") return "REFUSED";
    if (status == "skipped") continue;
    skipped = false;
    claim = row->Get(column::claim);
    verified += double(row->Get(column::verified).value_or(0));
    for (size_t e = 0; e < std::size(kPlainErrors); ++e)
      errors[e] += double(row->Get(kPlainErrors[e]).value_or(0));
  }
  if (skipped) return "skipped";
  if (claim == "nothing") return "claims nothing";
  std::string text;
  for (size_t e = 0; e < std::size(kPlainErrors); ++e)
    if (errors[e] > 0)
      text += fmt::format("{}{} {} %", text.empty() ? "" : ", ", kPlainErrors[e].name,
                          FormatFigure(100 * errors[e] / verified));
  if (verified == 0) return claim + ", not verified";
  if (claim == "inexact") return text.empty() ? "inexact, no error seen" : text;
  return claim + " ok";
}

std::string Rate(const Row& row) {
  const auto rate = row.Get(column::rate);
  return rate ? FormatFigure(*rate * 1e-6) : "-";
}

/// A counter per ray, over all closest-hit rays of one tree.
std::string PerRay(const Rows& rows, ColumnOf<ColumnType::kNumber> counter) {
  double sum = 0, rays = 0;
  for (const Row* row : rows) {
    const auto value = row->Get(counter);
    if (!value || row->Get(column::query) != "closest") continue;
    const double n = double(*row->Get(column::rays));
    sum += *value * n;
    rays += n;
  }
  return rays > 0 ? FormatFigure(sum / rays) : "-";
}

std::string ColumnName(const Row& row, bool show_threads) {
  std::string name = row.Get(column::ray_set);
  if (row.Get(column::order) == "shuffled") name += "~";
  if (show_threads) name += fmt::format(" x{}", *row.Get(column::threads));
  return name;
}

/// Which parts of the ray sets were timed, in words; empty if always all of them.
std::string TimedParts(const Rows& scene) {
  uint64_t cases = 0, parts = 0;
  double smallest = 1;
  for (const Row* row : scene) {
    const auto timed = row->Get(column::timed_rays), rays = row->Get(column::rays);
    if (!timed || !rays) continue;
    ++cases;
    if (*timed == *rays) continue;
    ++parts;
    smallest = std::min(smallest, double(*timed) / double(*rays));
  }
  if (parts == 0) return {};
  return fmt::format(
      "  {} of {} timed on a part of the rays to stay within the budget, 1/{:.0f} at least: timed_rays\n",
      parts, cases, 1 / smallest);
}

std::string FormatScene(const Rows& scene) {
  std::vector<std::string> specs, sets, builds;
  std::map<std::string, Rows> by_spec;
  std::map<std::pair<std::string, std::string>, const Row*> at;  // (spec, column) -> row
  std::vector<std::pair<std::string, std::string>> notes;
  bool many_threads = false, shuffled = false;
  for (const Row* row : scene) {
    if (row->Get(column::query) != "build" && row->Get(column::threads) != scene.back()->Get(column::threads))
      many_threads = true;
    shuffled |= row->Get(column::order) == "shuffled";
  }
  const auto add = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const Row* row : scene) {
    const std::string spec = row->Get(column::spec);
    const bool build = row->Get(column::query) == "build";
    const std::string column = ColumnName(*row, build || many_threads);
    add(specs, spec);
    add(build ? builds : sets, column);
    by_spec[spec].push_back(row);
    at[{spec, column}] = row;
    const std::pair note(spec, row->Get(column::note));
    if (!note.second.empty() && std::find(notes.begin(), notes.end(), note) == notes.end())
      notes.push_back(note);
  }

  const Row& first = *scene.front();
  std::string text =
      fmt::format("{}: {} primitives\n\n", first.Get(column::scene), *first.Get(column::primitives));
  std::vector<std::string> header = {"structure", "verdict"};
  for (const std::string& build : builds) header.push_back(build + " ms");
  for (const char* name : {"steps/ray", "prims/ray", "MiB"}) header.push_back(name);
  Grid properties(header);
  for (const std::string& spec : specs) {
    const Rows& rows = by_spec[spec];
    const Row& own = *rows.front();
    std::vector<std::string> cells = {spec, Verdict(rows)};
    for (const std::string& build : builds) {
      const auto found = at.find({spec, build});
      const auto ns = found == at.end() ? std::nullopt : found->second->Get(column::median_ns);
      cells.push_back(ns ? FormatFigure(*ns * 1e-6) : "-");
    }
    cells.push_back(PerRay(rows, column::steps));
    cells.push_back(PerRay(rows, column::prims));
    const auto nodes = own.Get(column::node_bytes);
    cells.push_back(nodes ? FormatFigure(double(*nodes + *own.Get(column::prim_bytes)) / (1 << 20)) : "-");
    properties.Add(cells);
  }
  text += properties.Format(2);

  if (!sets.empty()) {
    std::string anchor;
    for (const Row* row : scene)
      if (anchor.empty()) anchor = row->Get(column::anchor);
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
        if (cell != "-" && spec != anchor && found->second->Get(column::claim) != "nothing") {
          const auto own = found->second->Get(column::median_ns),
                     base = found->second->Get(column::anchor_ns);
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

std::string FormatTable(std::span<const FinishedCase> cases) {
  std::vector<std::string> order;
  std::map<std::string, Rows> scenes;
  for (const FinishedCase& finished : cases) {
    const std::string scene = finished.row.Get(column::scene);
    if (!scenes.contains(scene)) order.push_back(scene);
    scenes[scene].push_back(&finished.row);
  }
  std::string text;
  for (const std::string& scene : order) text += FormatScene(scenes[scene]);
  return text;
}

}  // namespace raybench
