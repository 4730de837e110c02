#include "accel/host/parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>

#include "accel/host/names.h"

namespace raybench {
namespace {

std::string_view Trim(std::string_view text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front()))) text.remove_prefix(1);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.remove_suffix(1);
  return text;
}

/// Letters to add, drop, change or swap with their neighbour, case aside: the distance of Damerau 1964 in the
/// form that touches no place twice.
size_t Slips(std::string_view a, std::string_view b) {
  const auto same = [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) == std::tolower(static_cast<unsigned char>(y));
  };
  std::vector<std::vector<size_t>> d(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i)
    for (size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + !same(a[i - 1], b[j - 1])});
      if (i > 1 && j > 1 && same(a[i - 1], b[j - 2]) && same(a[i - 2], b[j - 1]))
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

bool IsName(std::string_view text) {
  if (text.empty()) return false;
  for (char c : text) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-' && c != '.') return false;
  }
  return true;
}

template <class T>
void Store(std::byte* config, const rb_param& param, T value) {
  std::memcpy(config + param.offset, &value, sizeof value);
}
template <class T>
T Load(const std::byte* config, const rb_param& param) {
  T value;
  std::memcpy(&value, config + param.offset, sizeof value);
  return value;
}

std::vector<std::string_view> Choices(const rb_param& param) {
  std::vector<std::string_view> names;
  if (param.type == RB_BOOL) return {"false", "true"};
  for (const char* const* c = param.choices; c != nullptr && *c != nullptr; ++c) names.push_back(*c);
  return names;
}

std::string Allowed(const rb_param& param) {
  switch (param.type) {
    case RB_INT:
      return fmt::format("an integer from {} to {}", int64_t(param.lo), int64_t(param.hi));
    case RB_FLOAT:
      return fmt::format("a number from {} to {}", param.lo, param.hi);
    default:
      return fmt::format("{}", fmt::join(Choices(param), ", "));
  }
}

void SetDefault(std::byte* config, const rb_param& param) {
  switch (param.type) {
    case RB_INT:
      Store(config, param, int64_t(param.def));
      break;
    case RB_FLOAT:
      Store(config, param, param.def);
      break;
    default:
      Store(config, param, uint32_t(param.def));
      break;
  }
}

bool SetFromText(std::byte* config, const rb_param& param, std::string_view text) {
  const char* end = text.data() + text.size();
  if (param.type == RB_INT) {
    int64_t value = 0;
    auto [p, error] = std::from_chars(text.data(), end, value);
    if (error != std::errc() || p != end || double(value) < param.lo || double(value) > param.hi)
      return false;
    Store(config, param, value);
    return true;
  }
  if (param.type == RB_FLOAT) {
    double value = 0;
    auto [p, error] = std::from_chars(text.data(), end, value);
    if (error != std::errc() || p != end || !(value >= param.lo && value <= param.hi)) return false;
    Store(config, param, value);
    return true;
  }
  std::vector<std::string_view> names = Choices(param);
  for (uint32_t i = 0; i < names.size(); ++i) {
    if (names[i] == text) {
      Store(config, param, i);
      return true;
    }
  }
  return false;
}

/// With blanks for line breaks and tabs: messages quote it, and are one line. Other control characters are refused.
std::string PlainText(std::string_view text) {
  std::string plain(text);
  std::ranges::replace_if(
      plain, [](unsigned char c) { return std::isspace(c) != 0; }, ' ');
  const std::string allowed = plain;
  std::ranges::replace_if(
      plain, [](unsigned char c) { return std::iscntrl(c) != 0; }, '?');
  if (plain != allowed)
    throw InputError(fmt::format("'{}': control characters, shown as ?, are not allowed", plain));
  return plain;
}

}  // namespace

std::string DidYouMean(std::string_view typed, std::span<const std::string_view> known) {
  std::string_view best;
  size_t fewest = std::max<size_t>(1, typed.size() / 3) + 1;
  for (std::string_view name : known) {
    const size_t slips = Slips(typed, name);
    if (slips < fewest && slips < name.size()) {
      fewest = slips;
      best = name;
    }
  }
  return best.empty() ? std::string() : fmt::format(" (did you mean {}?)", best);
}

Spec ParseSpec(std::string_view text) {
  const std::string plain = PlainText(text);
  std::string_view whole = Trim(plain);
  Spec spec;
  size_t open = whole.find('(');
  spec.name = std::string(Trim(whole.substr(0, open)));
  if (!IsName(spec.name)) {
    throw InputError(fmt::format("'{}': expected NAME or NAME(key=value,...)", whole));
  }
  if (open == std::string_view::npos) return spec;
  if (whole.back() != ')') throw InputError(fmt::format("'{}': the closing ')' is missing", whole));
  std::string_view list = whole.substr(open + 1, whole.size() - open - 2);
  if (list.find_first_of("()") != std::string_view::npos) {
    throw InputError(fmt::format("'{}': parentheses do not nest", whole));
  }
  while (!Trim(list).empty()) {
    size_t comma = list.find(',');
    std::string_view item = Trim(list.substr(0, comma));
    size_t equals = item.find('=');
    std::string key(Trim(item.substr(0, equals)));
    if (equals == std::string_view::npos || !IsName(key) || Trim(item.substr(equals + 1)).empty()) {
      throw InputError(fmt::format("'{}': '{}' is not of the form key=value", whole, item));
    }
    for (const auto& [known, value] : spec.values) {
      if (known == key) throw InputError(fmt::format("'{}': '{}' is given twice", whole, key));
    }
    spec.values.emplace_back(key, std::string(Trim(item.substr(equals + 1))));
    if (comma == std::string_view::npos) break;
    list.remove_prefix(comma + 1);
    if (Trim(list).empty()) throw InputError(fmt::format("'{}': nothing follows the last comma", whole));
  }
  return spec;
}

std::vector<std::string> SplitSpecs(std::string_view text) {
  const std::string list = PlainText(text);
  std::vector<std::string> items;
  int depth = 0;
  size_t start = 0;
  for (size_t i = 0; i <= list.size(); ++i) {
    if (i == list.size() || (list[i] == ',' && depth == 0)) {
      std::string_view item = Trim(std::string_view(list).substr(start, i - start));
      if (item.empty()) throw InputError(fmt::format("'{}': an item of the list is empty", list));
      items.emplace_back(item);
      start = i + 1;
    } else if (list[i] == '(') {
      ++depth;
    } else if (list[i] == ')') {
      --depth;
    }
  }
  return items;
}

std::vector<std::byte> Configure(std::string_view owner, std::span<const rb_param> params, size_t config_size,
                                 std::span<const std::pair<std::string, std::string>> values) {
  std::vector<std::byte> config(config_size);
  for (const rb_param& param : params) SetDefault(config.data(), param);
  for (const auto& [key, value] : values) {
    const rb_param* found = nullptr;
    std::vector<std::string_view> names;
    for (const rb_param& param : params) {
      names.push_back(param.name);
      if (key == param.name) found = &param;
    }
    if (found == nullptr) {
      throw InputError(names.empty() ? fmt::format("{} has no parameter '{}': it has none", owner, key)
                                     : fmt::format("{} has no parameter '{}'{}; allowed: {}", owner, key,
                                                   DidYouMean(key, names), fmt::join(names, ", ")));
    }
    if (!SetFromText(config.data(), *found, value)) {
      throw InputError(fmt::format("{}: {}={} is not allowed{}; allowed: {}", owner, key, value,
                                   found->type == RB_INT || found->type == RB_FLOAT
                                       ? std::string()
                                       : DidYouMean(value, Choices(*found)),
                                   Allowed(*found)));
    }
  }
  return config;
}

std::string FlawOfParameters(std::span<const rb_param> params, size_t config_size) {
  for (size_t i = 0; i < params.size(); ++i) {
    const rb_param& p = params[i];
    if (p.name == nullptr || !IsName(p.name))
      return fmt::format("parameter {}: its name is not made of letters, digits, '_', '-' and '.'", i);
    const auto flaw = [&](const std::string& text) {
      return fmt::format("parameter '{}': {}", p.name, text);
    };
    if (p.doc == nullptr) return flaw("it lacks doc");
    if (p.type > RB_CHOICE) return flaw(fmt::format("its type {} is unknown", p.type));
    for (size_t j = 0; j < i; ++j)
      if (std::string_view(params[j].name) == p.name) return flaw("there are two of this name");
    const size_t size = p.type == RB_INT || p.type == RB_FLOAT ? 8 : 4;
    if (p.offset % size != 0 || p.offset > config_size || config_size - p.offset < size)
      return flaw(fmt::format("{} bytes at offset {} do not lie, aligned, in a configuration of {}", size,
                              p.offset, config_size));
    for (size_t j = 0; j < i; ++j) {
      const size_t other = params[j].type == RB_INT || params[j].type == RB_FLOAT ? 8 : 4;
      if (p.offset < params[j].offset + other && params[j].offset < p.offset + size)
        return flaw(fmt::format("it shares bytes with parameter '{}'", params[j].name));
    }
    if (p.type == RB_INT || p.type == RB_FLOAT) {
      if (!(std::isfinite(p.lo) && std::isfinite(p.hi) && p.lo <= p.hi && p.def >= p.lo && p.def <= p.hi))
        return flaw(fmt::format("default {} and range {} to {} do not fit", p.def, p.lo, p.hi));
      if (p.type == RB_INT && (p.lo < -0x1p63 || p.hi >= 0x1p63 || p.lo != std::trunc(p.lo) ||
                               p.hi != std::trunc(p.hi) || p.def != std::trunc(p.def)))
        return flaw(fmt::format("default {} and range {} to {} are no 64-bit integers", p.def, p.lo, p.hi));
      continue;
    }
    if (p.type == RB_CHOICE && p.choices == nullptr) return flaw("it lacks choices");
    const std::vector<std::string_view> choices = Choices(p);
    if (choices.empty()) return flaw("it has no choices");
    for (size_t c = 0; c < choices.size(); ++c)
      if (!IsName(choices[c]) || std::find(choices.begin(), choices.begin() + ptrdiff_t(c), choices[c]) !=
                                     choices.begin() + ptrdiff_t(c))
        return flaw(fmt::format("choice {} '{}' cannot be written or is there twice", c, choices[c]));
    if (!(p.def >= 0 && p.def < double(choices.size()) && p.def == std::trunc(p.def)))
      return flaw(fmt::format("default {} is none of its {} choices", p.def, choices.size()));
  }
  return {};
}

std::string FormatParameter(const rb_param& param, const std::byte* config) {
  switch (param.type) {
    case RB_INT:
      return fmt::format("{}", Load<int64_t>(config, param));
    case RB_FLOAT:
      return fmt::format("{}", Load<double>(config, param));
    default:
      return std::string(Choices(param)[Load<uint32_t>(config, param)]);
  }
}

std::string FormatAllParameters(std::span<const rb_param> params, const std::byte* config) {
  std::string text;
  for (const rb_param& param : params) {
    text += fmt::format("{}{}={}", text.empty() ? "" : ",", param.name, FormatParameter(param, config));
  }
  return text;
}

std::string FormatSpec(std::string_view name, std::span<const rb_param> params, const std::byte* config) {
  std::string text;
  for (const rb_param& param : params) {
    std::vector<std::byte> defaults(param.offset + sizeof(uint64_t));
    SetDefault(defaults.data(), param);
    std::string value = FormatParameter(param, config);
    if (value == FormatParameter(param, defaults.data())) continue;
    text += fmt::format("{}{}={}", text.empty() ? "" : ",", param.name, value);
  }
  return text.empty() ? std::string(name) : fmt::format("{}({})", name, text);
}

}  // namespace raybench
