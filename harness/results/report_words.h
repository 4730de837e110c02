// A command of the Python part that starts this program in turn, from options that were read already.
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "harness/results/python.h"

namespace raybench {

/// The words for Reports::Run(). Options go as NAME=VALUE, so that no value is taken for an option's name.
class ReportWords {
 public:
  /// `plugins`: shared libraries that this program is to load there, too.
  ReportWords(const char* command, const std::vector<std::string>& plugins) : words_{command} {
    Option("--program", ThisProgram());
    Option("--plugin", plugins);
  }

  /// Adds an option; nothing where it was not given: an optional without a value, an empty text outside of one, a
  /// false flag. A list is an option repeated.
  template <class T>
  void Option(const char* name, const T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      if (value) words_.emplace_back(name);
    } else if constexpr (std::is_same_v<T, std::string>) {
      if (!value.empty()) Add(name, value);
    } else {
      Add(name, value);
    }
  }
  template <class T>
  void Option(const char* name, const std::optional<T>& value) {
    if (value) Add(name, *value);
  }
  void Option(const char* name, const std::vector<std::string>& values) {
    for (const std::string& value : values) Add(name, value);
  }
  /// What is no option, whatever it begins with; after all options.
  void Operands(const std::vector<std::string>& values) {
    words_.emplace_back("--");
    words_.insert(words_.end(), values.begin(), values.end());
  }

  const std::vector<std::string>& all() const { return words_; }

 private:
  template <class T>
  void Add(const char* name, const T& value) {
    words_.push_back(fmt::format("{}={}", name, value));
  }

  std::vector<std::string> words_;
};

}  // namespace raybench
