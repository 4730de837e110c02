// FNV-1a style 64-bit content hash, eight bytes a step: names geometry and ray sets. Not cryptographic.
//
//   state = 0xCBF29CE484222325
//   for each array, for each 8 bytes of it (the last ones filled up with zeros), as little-endian word w:
//     state = (state ^ w) * 0x9FB21C651E98DF25;  state ^= state >> 29
//   value = state ^ state >> 32;  value *= 0xD6E8FEB86659FD93;  value ^= value >> 32
//
// Other programs compute it too (tracer/rays/RAYS.md), so it is not to be changed.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace raybench {

static_assert(std::endian::native == std::endian::little, "hashes and files are little-endian");

class Hash64 {
 public:
  void Add(const void* data, size_t size) {
    const char* p = static_cast<const char*>(data);
    for (; size >= 8; p += 8, size -= 8) Mix(Load(p, 8));
    if (size > 0) Mix(Load(p, size));
  }
  template <class T>
  void AddValue(const T& value) {
    Add(&value, sizeof value);
  }
  void Add(std::string_view text) {
    AddValue(uint64_t{text.size()});
    Add(text.data(), text.size());
  }

  uint64_t value() const {
    uint64_t h = state_;
    h ^= h >> 32, h *= 0xD6E8FEB86659FD93u, h ^= h >> 32;
    return h;
  }
  std::string Hex() const {
    static const char digits[] = "0123456789abcdef";
    std::string text(16, '0');
    uint64_t h = value();
    for (int i = 15; i >= 0; --i, h >>= 4) text[size_t(i)] = digits[h & 15];
    return text;
  }

 private:
  static uint64_t Load(const char* p, size_t n) {
    uint64_t word = 0;
    std::memcpy(&word, p, n);
    return word;
  }
  void Mix(uint64_t word) {
    state_ = (state_ ^ word) * 0x9FB21C651E98DF25u;
    state_ ^= state_ >> 29;
  }
  uint64_t state_ = 0xCBF29CE484222325u;
};

}  // namespace raybench
