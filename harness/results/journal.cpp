#include "harness/results/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "accel/base/error.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// What a power cut takes at most. Forcing every line to disk would take longer than many a sample.
constexpr std::chrono::seconds kSyncInterval(1);

std::string Line(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace

Json ToJson(const Sample& s) {
  return {{"sample", s.sample},     {"sequence", s.sequence},    {"passes", s.passes},
          {"seconds", s.time.wall}, {"cpu_seconds", s.time.cpu}, {"process", s.process},
          {"session", s.session}};
}

Sample SampleFrom(const Json& json) {
  return {.sample = json.at("sample"),
          .sequence = json.at("sequence"),
          .passes = json.at("passes"),
          .time = {json.at("seconds"), json.at("cpu_seconds")},
          .process = json.value("process", uint64_t{0}),
          .session = json.value("session", uint64_t{0})};
}

Journal::Journal(fs::path path, Json depends_on, uint64_t session)
    : path_(std::move(path)), depends_on_(std::move(depends_on)), session_(session) {
  Read();
}

Journal::~Journal() {
  if (file_ >= 0) close(file_);
}

void Journal::Read() {
  std::ifstream in(path_, std::ios::binary);
  if (!in) return;
  std::ostringstream whole;
  whole << in.rdbuf();
  const std::string text = whole.str();
  uint64_t number = 0;
  for (size_t begin = 0, end; (end = text.find('\n', begin)) != text.npos; begin = end + 1) {
    ++number;
    const Json record = Json::parse(text.begin() + ptrdiff_t(begin), text.begin() + ptrdiff_t(end), nullptr,
                                    /*allow_exceptions=*/false);
    if (!record.is_object() || !record.contains(number == 1 ? "depends_on" : "kind"))
      throw InputError(
          fmt::format("{}: line {} is no record of this raybench; remove the file to measure "
                      "the unfinished cases anew",
                      path_.string(), number));
    if (number == 1) {
      dropped_ = record.at("depends_on") != depends_on_;
      if (dropped_) return;
    } else if (const std::string kind = record.at("kind"); kind == "session") {
      ++fruitless_;
    } else {
      fruitless_ = 0;
      samples_ += kind == "sample";
      records_[{kind, record.at("of")}].push_back(record);
    }
    whole_bytes_ = end + 1;
  }
}

const Json& Journal::Find(const std::string& kind, const std::string& key) const {
  static const Json kNull;
  const auto found = records_.find({kind, key});
  return found == records_.end() ? kNull : found->second.back();
}

void Journal::Open() {
  std::error_code error;
  fs::create_directories(path_.parent_path(), error);
  file_ = open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (file_ < 0 || ftruncate(file_, off_t(whole_bytes_)) != 0)
    throw InputError(fmt::format("{}: cannot be written: {}", path_.string(), std::strerror(errno)));
  Append((whole_bytes_ == 0 ? Line({{"depends_on", depends_on_}}) : "") +
         Line({{"kind", "session"}, {"of", ""}, {"session", session_}}));
}

void Journal::Append(const std::string& lines) {
  ssize_t written;
  do {
    written = write(file_, lines.data(), lines.size());
  } while (written < 0 && errno == EINTR);
  // A line written in part would have the next one behind it.
  if (written != ssize_t(lines.size())) {
    const int why = written < 0 ? errno : ENOSPC;
    if (ftruncate(file_, off_t(whole_bytes_)) != 0) close(std::exchange(file_, -1));
    throw InputError(fmt::format("{}: cannot be written: {}", path_.string(), std::strerror(why)));
  }
  whole_bytes_ += lines.size();
  const auto now = std::chrono::steady_clock::now();
  if (now - synced_ < kSyncInterval) return;
  fdatasync(file_);
  synced_ = now;
}

void Journal::Begin() {
  if (file_ < 0) Open();
}

void Journal::Add(const std::string& kind, const std::string& key, Json record) {
  Begin();
  Json whole = {{"kind", kind}, {"of", key}};
  whole.update(record);
  Append(Line(whole));
  samples_ += kind == "sample";
  records_[{kind, key}].push_back(std::move(whole));
}

std::vector<Sample> Journal::SamplesOf(const std::string& key) const {
  std::vector<Sample> samples;
  const auto found = records_.find({"sample", key});
  if (found == records_.end()) return samples;
  for (const Json& record : found->second) {
    samples.push_back(SampleFrom(record));
    samples.back().sample = samples.size() - 1;
  }
  return samples;
}

void Journal::AddSample(const std::string& key, const Sample& sample) {
  Sample own = sample;
  own.session = session_;
  Add("sample", key, ToJson(own));
}

void Journal::Remove() {
  if (file_ >= 0) close(std::exchange(file_, -1));
  records_.clear();
  samples_ = 0;
  whole_bytes_ = 0;
  std::error_code error;
  fs::remove(path_, error);
  fs::remove(path_.parent_path(), error);  // if it is empty
}

}  // namespace raybench
