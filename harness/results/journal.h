// What is known of a scene's unfinished cases, line by line as it comes to be known.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "harness/base/json.h"
#include "harness/measure/measure.h"

namespace raybench {

/// A file of JSON lines that is only appended to, each by one write(): a process that is killed loses what it
/// had not handed over yet, and what a power cut may take is a second's worth. The first line says what all
/// others depend on. Records have a kind ("sample", "build", ...) and a key ("of"); of some kinds there are
/// several with one key.
class Journal {
 public:
  /// Reads what is there; nothing is written before the first record. Records that depend on something else
  /// than `depends_on` are dropped. A last line without an end is dropped, too. Throws InputError naming file
  /// and line for any other line that is no record.
  Journal(std::filesystem::path path, Json depends_on, uint64_t session);
  Journal(const Journal&) = delete;
  ~Journal();

  /// Whether there were records, which depended on something else.
  bool dropped() const { return dropped_; }
  uint64_t session() const { return session_; }
  /// Says that this session has begun, unless it is said already.
  void Begin();
  /// Sessions just before this one that began and left no record behind.
  uint64_t FruitlessSessions() const { return fruitless_; }
  uint64_t samples() const { return samples_; }

  /// The newest of this kind and key, or null.
  const Json& Find(const std::string& kind, const std::string& key) const;
  /// Throws InputError when it cannot be written.
  void Add(const std::string& kind, const std::string& key, Json record);

  /// In the order in which they were taken.
  std::vector<Sample> SamplesOf(const std::string& key) const;
  /// Of this session.
  void AddSample(const std::string& key, const Sample& sample);

  /// Nothing is unfinished any more.
  void Remove();

 private:
  void Read();
  void Open();
  void Append(const std::string& lines);

  const std::filesystem::path path_;
  const Json depends_on_;
  const uint64_t session_;
  uint64_t fruitless_ = 0, samples_ = 0;
  bool dropped_ = false;
  std::map<std::pair<std::string, std::string>, std::vector<Json>> records_;
  uint64_t whole_bytes_ = 0;  ///< of the file, up to the end of its last whole line
  int file_ = -1;
  std::chrono::steady_clock::time_point synced_;
};

/// For case files and journals.
Json ToJson(const Sample& sample);
/// Throws what JSON throws. Without `process` and `session` they are 0.
Sample SampleFrom(const Json& json);

}  // namespace raybench
