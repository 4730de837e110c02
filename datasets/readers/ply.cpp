// PLY, the Polygon File Format (Turk 1994): ASCII, binary little-endian and binary big-endian.
//
// The header describes the elements, which may come in any order and have any properties. What matters
// here is x, y and z of `vertex`, the list vertex_indices of `face` and that of `tristrips`; everything
// else is skipped.

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "datasets/readers/readers.h"
#include "datasets/readers/text_reader.h"

namespace raybench {
namespace {

enum class Type : uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
constexpr size_t kTypeSize[] = {1, 1, 2, 2, 4, 4, 4, 8};
constexpr struct {
  std::string_view name, old_name;
} kTypeNames[] = {{"int8", "char"}, {"uint8", "uchar"}, {"int16", "short"},   {"uint16", "ushort"},
                  {"int32", "int"}, {"uint32", "uint"}, {"float32", "float"}, {"float64", "double"}};

size_t SizeOf(Type type) { return kTypeSize[size_t(type)]; }
bool IsInteger(Type type) { return type < Type::kFloat32; }

template <class T, class Bits>
double Decode(const char* p, bool swap) {
  Bits bits;
  std::memcpy(&bits, p, sizeof bits);
  if (swap) {
    if constexpr (sizeof bits == 2) bits = __builtin_bswap16(bits);
    if constexpr (sizeof bits == 4) bits = __builtin_bswap32(bits);
    if constexpr (sizeof bits == 8) bits = __builtin_bswap64(bits);
  }
  return double(std::bit_cast<T>(bits));
}

constexpr size_t kMaxElements = 1000;

/// Every type's values are doubles.
double Decode(const char* p, Type type, bool swap) {
  switch (type) {
    case Type::kInt8:
      return double(int8_t(*p));
    case Type::kUint8:
      return double(uint8_t(*p));
    case Type::kInt16:
      return Decode<int16_t, uint16_t>(p, swap);
    case Type::kUint16:
      return Decode<uint16_t, uint16_t>(p, swap);
    case Type::kInt32:
      return Decode<int32_t, uint32_t>(p, swap);
    case Type::kUint32:
      return Decode<uint32_t, uint32_t>(p, swap);
    case Type::kFloat32:
      return double(Decode<float, uint32_t>(p, swap));
    case Type::kFloat64:
      break;
  }
  return Decode<double, uint64_t>(p, swap);
}

enum class Role : uint8_t { kNone, kX, kY, kZ, kCorners };

struct Property {
  std::string name;
  Type type = Type::kFloat32, count_type = Type::kUint8;
  bool is_list = false;
  Role role = Role::kNone;
};

enum class Kind : uint8_t { kOther, kVertex, kFace, kStrips };

struct Element {
  std::string name;
  uint64_t count = 0;
  Kind kind = Kind::kOther;
  std::vector<Property> properties;
};

class PlyReader : MeshReader {
 public:
  PlyReader(const std::filesystem::path& path, const LoadOptions& options, Scene& scene)
      : MeshReader(path, ReadFile(path), options, scene) {}

  void Run() {
    ReadHeader();
    CheckSizes();
    Expect(CountOf(Kind::kVertex), CountOf(Kind::kFace));
    for (const Element& element : elements_)
      for (item_ = 0; item_ < element.count && !element.properties.empty(); ++item_) {
        is_ascii_ ? AsciiItem(element) : BinaryItem(element);
        if (element.kind == Kind::kVertex) sink_.AddVertex(vertex_);
        if (element.kind == Kind::kFace) AddCorners(corners_);
        if (element.kind == Kind::kStrips) AddStrips();
        TellProgress(Offset());
      }
    CheckEnd();
    if (sink_.faces() == 0) Fail("has no faces");
    FindLeftOut();
    sink_.Close();
  }

 private:
  std::string Where() const override {
    return is_ascii_ || offset_ == 0 ? TextReader::Where() : fmt::format("byte {}", offset_);
  }
  size_t Offset() const { return is_ascii_ ? lines_.offset() : offset_; }

  // ---- header ----

  Words HeaderLine() {
    std::string_view line;
    if (!lines_.Next(line)) FailEarly("end_header");
    return Words(line);
  }

  /// Lines end as the first one does: in "\n" or "\r\n", in "\r" or, turned round, in "\n\r". Those two
  /// become what the others are, so that binary data begin right behind the last.
  void FindLineEnds() {
    if (text_.starts_with("\xEF\xBB\xBF"))
      start_ = 3;
    else if (text_.starts_with("\xFF\xFE") || text_.starts_with("\xFE\xFF"))
      MakePlain(path_, text_);
    const size_t first = text_.find_first_of("\r\n", start_);
    if (first == text_.npos || first + 1 >= text_.size()) return;
    const char end_mark = text_[first];
    const bool is_turned = end_mark == '\n' && text_[first + 1] == '\r',
               is_single = end_mark == '\r' && text_[first + 1] != '\n';
    if (!is_turned && !is_single) return;
    constexpr std::string_view kLast = "end_header";
    const size_t last = text_.find(fmt::format("{}{}{}", end_mark, is_turned ? "\r" : "", kLast), first);
    const size_t end = last == text_.npos ? last : text_.find(end_mark, last + 1);
    if (end == text_.npos || end + is_turned >= text_.size()) return;
    for (size_t i = first; i <= end; ++i) {
      if (text_[i] != end_mark) continue;
      if (is_turned && text_[i + 1] == '\r') {
        std::swap(text_[i], text_[i + 1]);
        ++i;
      }
      if (is_single) text_[i] = '\n';
    }
  }

  void ReadHeader() {
    FindLineEnds();
    lines_ = Lines(text_, start_);
    const Words first = HeaderLine();
    if (std::string_view magic = Words(first).Next(); magic != "ply" && magic != "PLY")
      FailHere(fmt::format("begins with {}; a PLY file begins with 'ply'", Quoted(magic)));
    bool has_format = false;
    while (true) {
      Words words = HeaderLine();
      const std::string_view key = words.Next();
      if (key == "end_header") break;
      if (key == "format") {
        ReadFormat(words);
        has_format = true;
      } else if (key == "element") {
        ReadElement(words);
      } else if (key == "property") {
        ReadProperty(words);
      } else if (!key.empty() && key != "comment" && key != "obj_info") {
        FailHere(
            fmt::format("{} is no header line; allowed are format, comment, obj_info, element, property and "
                        "end_header",
                        Quoted(key)));
      }
    }
    if (!has_format) Fail("the header has no format line");
    offset_ = lines_.offset();
    if (is_ascii_) MakeLineEndsPlain(text_, offset_);
    CheckElements();
  }

  void ReadFormat(Words& words) {
    const std::string_view format = words.Next();
    if (format == "ascii") {
      is_ascii_ = true;
    } else if (format == "binary_little_endian" || format == "binary_big_endian") {
      is_ascii_ = false;
      swap_ = (format == "binary_big_endian") != (std::endian::native == std::endian::big);
    } else {
      FailHere(fmt::format("the format is {}; allowed are ascii, binary_little_endian and binary_big_endian",
                           Quoted(format)));
    }
    if (const std::string_view version = words.Next(); version != "1.0")
      FailHere(fmt::format("the version is {}; 1.0 is read", Quoted(version)));
  }

  void ReadElement(Words& words) {
    if (elements_.size() == kMaxElements) FailHere(fmt::format("has more than {} elements", kMaxElements));
    Element& element = elements_.emplace_back();
    element.name = words.Next();
    int64_t count = 0;
    const std::string_view word = words.Next();
    if (!ParseInt(word, count) || count < 0 || count > kMaxCount)
      FailHere(fmt::format("element {} has the count {}; allowed are 0 to {}", Quoted(element.name),
                           Quoted(word), kMaxCount));
    element.count = uint64_t(count);
    element.kind = element.name == "vertex"      ? Kind::kVertex
                   : element.name == "face"      ? Kind::kFace
                   : element.name == "tristrips" ? Kind::kStrips
                                                 : Kind::kOther;
    for (size_t i = 0; i + 1 < elements_.size(); ++i)
      if (elements_[i].name == element.name)
        FailHere(fmt::format("element {} is there twice", Quoted(element.name)));
  }

  Type ReadType(std::string_view word) const {
    for (size_t i = 0; i < std::size(kTypeNames); ++i)
      if (word == kTypeNames[i].name || word == kTypeNames[i].old_name) return Type(i);
    FailHere(
        fmt::format("{} is no type; allowed are char, uchar, short, ushort, int, uint, float and double, or "
                    "int8 to float64",
                    Quoted(word)));
  }

  void ReadProperty(Words& words) {
    if (elements_.empty()) FailHere("a property stands before the first element");
    Element& element = elements_.back();
    Property p;
    std::string_view word = words.Next();
    if (word == "list") {
      p.is_list = true;
      p.count_type = ReadType(words.Next());
      if (!IsInteger(p.count_type)) FailHere("a list must be counted by an integer type");
      word = words.Next();
    }
    p.type = ReadType(word);
    p.name = words.Next();
    if (p.name.empty()) FailHere("a property needs a name");
    if (element.kind == Kind::kVertex && !p.is_list && p.name.size() == 1)
      p.role = p.name == "x" ? Role::kX : p.name == "y" ? Role::kY : p.name == "z" ? Role::kZ : Role::kNone;
    if ((element.kind == Kind::kFace || element.kind == Kind::kStrips) && p.is_list &&
        (p.name == "vertex_indices" || p.name == "vertex_index")) {
      if (!IsInteger(p.type)) FailHere(fmt::format("{} must be a list of integers", p.name));
      p.role = Role::kCorners;
    }
    if (p.role != Role::kNone)
      for (const Property& other : element.properties)
        if (other.role == p.role) FailHere(fmt::format("property {} is there twice", Quoted(p.name)));
    element.properties.push_back(std::move(p));
  }

  void CheckElements() {
    bool has_vertices = false, has_faces = false;
    for (const Element& element : elements_) {
      auto has = [&](Role role) {
        for (const Property& p : element.properties)
          if (p.role == role) return true;
        return false;
      };
      if (element.kind == Kind::kVertex) {
        has_vertices = true;
        if (!has(Role::kX) || !has(Role::kY) || !has(Role::kZ))
          Fail("the header's element vertex needs the properties x, y and z");
      } else if (element.kind != Kind::kOther) {
        has_faces = true;
        if (!has(Role::kCorners))
          Fail(fmt::format("the header's element {} needs the property list vertex_indices", element.name));
      }
    }
    if (!has_vertices) Fail("the header has no element vertex");
    if (!has_faces) Fail("the header has no element face; point clouds have nothing to hit");
  }

  uint64_t CountOf(Kind kind) const {
    for (const Element& element : elements_)
      if (element.kind == kind) return element.count;
    return 0;
  }

  /// What the header claims must fit into the file before anything is allocated.
  void CheckSizes() const {
    uint64_t needed = 0;  // each count is below 2^31, and so is the number of properties: no overflow
    for (const Element& element : elements_) {
      uint64_t item = 0;
      for (const Property& p : element.properties)
        item += is_ascii_ ? 2 : SizeOf(p.is_list ? p.count_type : p.type);
      needed += element.count * item;
      const uint64_t left = text_.size() - offset_ + is_ascii_;  // the last line may have no end
      if (needed > left)
        Fail(
            fmt::format("ends early: the header's {} items of element {} take {} bytes at least with what is "
                        "before them; {} follow the header",
                        element.count, Quoted(element.name), needed, left));
    }
  }

  // ---- items ----

  void AsciiItem(const Element& element) {
    std::string_view line;
    do
      if (!lines_.Next(line)) FailEarly(fmt::format("{} {} of {}", element.name, item_, element.count));
    while (Words(line).Next().empty());
    Words words(line);
    auto next = [&](const Property& p) {
      const std::string_view word = words.Next();
      if (word.empty())
        FailHere(fmt::format("{} {} ends before its property {}", element.name, item_, Quoted(p.name)));
      return word;
    };
    for (const Property& p : element.properties) {
      if (p.is_list) {
        int64_t count = 0;
        const std::string_view word = next(p);
        if (!ParseInt(word, count) || count < 0 || count > int64_t(text_.size()))
          FailHere(fmt::format("{} {} has the list length {}", element.name, item_, Quoted(word)));
        if (p.role != Role::kCorners) {
          for (int64_t i = 0; i < count; ++i) next(p);
          continue;
        }
        corners_.clear();
        for (int64_t i = 0; i < count; ++i) corners_.push_back(Index(next(p), element.name, item_));
      } else {
        const std::string_view word = next(p);
        if (p.role != Role::kNone) vertex_[int(p.role) - int(Role::kX)] = Coordinate(word);
      }
    }
    if (!words.Next().empty())
      FailHere(fmt::format("{} {} has more values than the {} properties of the header", element.name, item_,
                           element.properties.size()));
  }

  const char* Bytes(uint64_t count, const Element& element) {
    if (count > text_.size() - offset_)
      Fail(fmt::format("ends early at byte {}: {} {} of {} needs {} more bytes from byte {} on", text_.size(),
                       element.name, item_, element.count, count, offset_));
    const char* p = text_.data() + offset_;
    offset_ += count;
    return p;
  }

  void BinaryItem(const Element& element) {
    for (const Property& p : element.properties) {
      const size_t size = SizeOf(p.type);
      if (p.is_list) {
        const double count = Decode(Bytes(SizeOf(p.count_type), element), p.count_type, swap_);
        if (count < 0) FailHere(fmt::format("{} {} has the list length {}", element.name, item_, count));
        const char* values = Bytes(uint64_t(count) * size, element);
        if (p.role != Role::kCorners) continue;
        corners_.resize(size_t(count));
        for (int64_t& corner : corners_) {
          corner = int64_t(Decode(values, p.type, swap_));
          values += size;
        }
      } else {
        const char* bytes = Bytes(size, element);
        if (p.role == Role::kNone) continue;
        const float value = float(Decode(bytes, p.type, swap_));
        if (!std::isfinite(value) && !options_.drop_bad) {
          offset_ -= size;
          FailHere(
              fmt::format("vertex {} has {} = {}; it must be finite{}", item_, p.name, value, kOrDropBad));
        }
        vertex_[int(p.role) - int(Role::kX)] = value;
      }
    }
  }

  void CheckEnd() const {
    if (options_.drop_bad) return;
    const size_t end = Offset();
    if (end < text_.size() && text_.find_first_not_of(std::string_view(" \t\r\n\0", 5), end) != text_.npos)
      Fail(fmt::format("has {} bytes more than the header says", text_.size() - end));
  }

  void FindLeftOut() {
    std::string left;
    const auto add = [&](const std::string& what) {
      left += fmt::format("{}{}", left.empty() ? "" : "; ", what);
    };
    for (const Element& element : elements_) {
      if (element.count == 0) continue;
      if (element.kind == Kind::kOther) {
        add(fmt::format("{} of element {}", element.count, Quoted(element.name)));
        continue;
      }
      Counts properties;
      for (const Property& p : element.properties)
        if (p.role == Role::kNone) properties.Add(p.name);
      if (!properties.empty()) add(fmt::format("properties of {}: {}", element.name, properties.Text()));
    }
    if (!left.empty()) NoteLeftOut(OneLine(left));
  }

  void AddCorners(std::span<const int64_t> indices) {
    face_.clear();
    for (int64_t index : indices) face_.push_back(Corner(index));
    AddFace(face_);
  }

  /// Triangle strips, ended by -1; every other triangle is turned round. Each triangle is a face.
  void AddStrips() {
    size_t begin = 0;
    for (size_t i = 0; i < corners_.size(); ++i) {
      if (corners_[i] == -1) {
        begin = i + 1;
      } else if (i >= begin + 2) {
        const bool is_turned = (i - begin) % 2 == 1;
        const int64_t corners[3] = {corners_[i - 2 + is_turned], corners_[i - 1 - is_turned], corners_[i]};
        AddCorners(corners);
      }
    }
  }

  bool is_ascii_ = true, swap_ = false;
  std::vector<Element> elements_;
  size_t start_ = 0;   ///< behind a byte-order mark
  size_t offset_ = 0;  ///< of what is read next in a binary file; 0 in the header
  uint64_t item_ = 0;
  Vec3f vertex_{0, 0, 0};
  std::vector<int64_t> corners_;
  std::vector<uint32_t> face_;
};

Scene ReadPly(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  PlyReader(path, options, scene).Run();
  return scene;
}

}  // namespace

const Format kPly = {".ply", ReadPly};

}  // namespace raybench
