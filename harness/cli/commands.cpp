#include "harness/cli/commands.h"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <optional>

namespace raybench {

const char* const kGoals = R"help(
I have a model. Which structure is fastest on it, and which ones are right?
  raybench run MODEL.glb --out DIR
I have rays that my own renderer recorded (tracer/rays/RAYS.md). Which structure is fastest on them?
  raybench run MODEL.ply --rays RAYS
I have a structure. Does it lose rays, and how fast is it?
  raybench check-plugin ./MINE.so
  raybench verify MODEL.glb --plugin ./MINE.so --structures MINE
  raybench run MODEL.glb --plugin ./MINE.so --structures MINE,bvh_sah,embree
I changed something. Is it slower, or are its answers or counters different?
  raybench check --run "OLD/raybench run MODEL.glb --quick" "raybench run MODEL.glb --quick"
I have results. How do I look at them, mail them, put figures of them into a paper?
  raybench report DIR
  raybench report DIR --figures
)help";

std::optional<uint64_t> ParseWholeNumber(std::string_view text, Units units) {
  uint64_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc()) return std::nullopt;
  std::string unit(rest, end);
  for (char& c : unit) c = c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c;
  if (unit.empty()) return value;
  if (units == Units::kNone) return std::nullopt;
  if (unit == "B") return value;
  constexpr std::string_view kPowers = "KMGTPE";
  const size_t power = kPowers.find(unit[0]);
  const std::string_view tail = std::string_view(unit).substr(1);
  if (power == kPowers.npos || !(tail.empty() || tail == "B" || tail == "IB")) return std::nullopt;
  const unsigned shift = unsigned(10 * (power + 1));
  if (value > UINT64_MAX >> shift) return std::nullopt;
  return value << shift;
}

CLI::Validator WholeNumber(uint64_t lo, uint64_t hi, Units units) {
  const auto take = [=](std::string& text) {
    const std::optional<uint64_t> value = ParseWholeNumber(text, units);
    if (!value || *value < lo || *value > hi)
      return fmt::format("'{}' is not allowed; allowed: a whole number from {} to {}{}", text, lo, hi,
                         units == Units::kSizes ? ", also such as 64K, 1M or 2G" : "");
    text = fmt::format("{}", *value);
    return std::string();
  };
  return CLI::Validator(take, "");
}

CLI::Validator RealNumber(double lo, double hi) {
  const auto take = [=](std::string& text) {
    double value = 0;
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data(), end, value);
    if (error != std::errc() || rest != end || !(value >= lo && value <= hi))
      return fmt::format("'{}' is not allowed; allowed: a number from {} to {}", text, lo, hi);
    return std::string();
  };
  return CLI::Validator(take, "");
}

RayWords ReadRayWords(const std::vector<std::string>& words) {
  RayWords rays;
  for (const std::string& word : words) {
    std::error_code error;
    if (const std::optional<uint64_t> number = ParseWholeNumber(word, Units::kSizes)) {
      if (*number < 64 || *number > uint64_t{1} << 28)
        throw InputError(fmt::format("--rays {}: the number of rays must be between 64 and 2^28", word));
      rays.number = *number;
    } else if (std::filesystem::exists(word, error)) {
      rays.files.push_back(word);
    } else {
      throw InputError(fmt::format(
          "--rays {}: neither a number of rays (such as 64K or 1M) nor a .rays file or a folder of them",
          word));
    }
  }
  return rays;
}

}  // namespace raybench
