// What a glTF 2.0 file is before its meaning: JSON text, alone or in a GLB, and the buffers it refers to. All
// of it is checked here, so that nothing else has to look at URIs, chunks or sizes of files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace raybench {

/// Encoded data and where they were found.
struct GltfResource {
  std::shared_ptr<const std::string> bytes;  ///< null: the file that the URI names is not there
  std::string source, mime_type;             ///< the type is empty where the URI does not say it
};

class GltfContainer {
 public:
  /// Reads the file and parses its JSON. Throws InputError beginning with the path: not there, empty, neither
  /// JSON nor GLB, cut off, another version, nested too deeply, a value of the wrong type.
  explicit GltfContainer(const std::filesystem::path& path);

  /// Of the types that the specification says (schema.h), whole numbers as integers; without its buffers.
  nlohmann::json root;

  /// The bytes of buffer `index`, exactly its byteLength; read at first use and kept. Throws InputError:
  /// missing, shorter than claimed, a URI that is not allowed.
  std::string_view Buffer(int64_t index);
  /// What a URI names: "data:" with base64, or a path relative to this file. At most `limit` bytes of a file
  /// are read. `what` ("buffer 3") begins the messages.
  GltfResource Resource(const std::string& uri, const std::string& what, uint64_t limit) const;
  /// Bytes of the file and of its buffers so far: what the file can justify.
  uint64_t size() const { return size_; }

  [[noreturn]] void Fail(const std::string& what) const;

 private:
  void OpenBinary();
  void ParseJson(std::string_view text);

  std::filesystem::path path_;
  std::string file_;
  std::string_view binary_;  // the BIN chunk
  bool has_binary_ = false;
  nlohmann::json buffer_list_;  // root's "buffers"
  struct File {
    uint64_t needed = 0;  // the largest byteLength of the buffers that name it
    std::shared_ptr<const std::string> bytes;
  };
  std::map<std::string, File> files_;  // by URI, but for "data:"
  std::vector<std::shared_ptr<const std::string>> decoded_;
  std::map<int64_t, std::string_view> buffers_;
  uint64_t size_ = 0;
};

}  // namespace raybench
