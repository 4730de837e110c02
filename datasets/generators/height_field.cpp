#include "datasets/generators/height_field.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <string_view>

#include "accel/base/files.h"
#include "datasets/readers/readers.h"

namespace raybench {
namespace {

constexpr uint32_t kMaxSide = 16384;
constexpr double kMeanEarthRadius = 6371008.8;  // metres; R1 of GRS 80 (Moritz 2000)

[[noreturn]] void Fail(const std::filesystem::path& path, const std::string& what) {
  throw InputError(path.string() + ": " + what);
}

template <class T>
T Swapped(T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  for (size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// The value at `p`, of any alignment.
template <class T>
T Load(const char* p, bool big_endian) {
  T value;
  std::memcpy(&value, p, sizeof(T));
  return big_endian == (std::endian::native == std::endian::big) ? value : Swapped(value);
}

template <class T>
void ReadHeights(const std::filesystem::path& path, std::string_view data, bool big_endian,
                 HeightField& field) {
  const uint64_t count = uint64_t(field.rows) * field.columns;
  if (data.size() != count * sizeof(T)) {
    Fail(path, fmt::format("has {} bytes of heights; {} x {} of {} bytes are needed", data.size(), field.rows,
                           field.columns, sizeof(T)));
  }
  field.heights.resize(count);
  for (uint64_t i = 0; i < count; ++i) {
    field.heights[i] = float(Load<T>(data.data() + i * sizeof(T), big_endian));
    if (!std::isfinite(field.heights[i])) {
      Fail(path,
           fmt::format("height in row {}, column {} is not finite", i / field.columns, i % field.columns));
    }
  }
}

void CheckSides(const std::filesystem::path& path, int64_t rows, int64_t columns) {
  if (rows < 2 || columns < 2 || rows > kMaxSide || columns > kMaxSide) {
    Fail(path, fmt::format("has {} x {} heights; each side must have 2 to {}", rows, columns, kMaxSide));
  }
}

/// What follows `key` and blanks in the header of a .npy file, which is a Python literal.
std::string_view ValueOf(const std::filesystem::path& path, std::string_view header, std::string_view key) {
  const size_t at = header.find(key);
  if (at == header.npos) Fail(path, fmt::format("its header has no {}", key));
  std::string_view value = header.substr(at + key.size());
  return value.substr(std::min(value.find_first_not_of(": "), value.size()));
}

}  // namespace

HeightField ReadNpy(const std::filesystem::path& path) {
  const std::string text = ReadFile(path);
  const std::string_view file = text;
  if (!file.starts_with("\x93NUMPY") || file.size() < 12) Fail(path, "is not a .npy file");
  const int version = file[6];
  if (version < 1 || version > 3) Fail(path, fmt::format("has .npy version {}; allowed are 1 to 3", version));
  const size_t begin = version == 1 ? 10 : 12;
  const size_t length = version == 1 ? Load<uint16_t>(&file[8], false) : Load<uint32_t>(&file[8], false);
  if (length > file.size() - begin) Fail(path, "ends inside its header");
  const std::string header(file.substr(begin, length));
  const std::string_view data = file.substr(begin + length);

  long long rows = 0, columns = 0;
  if (std::sscanf(std::string(ValueOf(path, header, "'shape'")).c_str(), "( %lld , %lld )", &rows,
                  &columns) != 2)
    Fail(path, "has not two dimensions");
  CheckSides(path, rows, columns);
  if (!ValueOf(path, header, "'fortran_order'").starts_with("False"))
    Fail(path, "is in Fortran order; C order is needed");
  HeightField field;
  field.rows = uint32_t(rows);
  field.columns = uint32_t(columns);
  const std::string_view type = ValueOf(path, header, "'descr'").substr(0, 5);
  const bool big_endian = type.starts_with("'>");
  if (type == "'<i2'" || type == "'>i2'") {
    ReadHeights<int16_t>(path, data, big_endian, field);
  } else if (type == "'<i4'" || type == "'>i4'") {
    ReadHeights<int32_t>(path, data, big_endian, field);
  } else if (type == "'<f4'" || type == "'>f4'") {
    ReadHeights<float>(path, data, big_endian, field);
  } else if (type == "'<f8'" || type == "'>f8'") {
    ReadHeights<double>(path, data, big_endian, field);
  } else {
    Fail(path,
         fmt::format("has elements of type {}; allowed are i2, i4, f4, f8", OneLine(std::string(type))));
  }
  return field;
}

HeightField ReadGtx(const std::filesystem::path& path) {
  const std::string file = ReadFile(path);
  if (file.size() < 40) Fail(path, "ends inside its header of 40 bytes");
  HeightField field;
  field.south = Load<double>(&file[0], true);
  field.west = Load<double>(&file[8], true);
  field.latitude_step = Load<double>(&file[16], true);
  field.longitude_step = Load<double>(&file[24], true);
  const int32_t rows = Load<int32_t>(&file[32], true), columns = Load<int32_t>(&file[36], true);
  CheckSides(path, rows, columns);
  field.rows = uint32_t(rows);
  field.columns = uint32_t(columns);
  ReadHeights<float>(path, std::string_view(file).substr(40), true, field);
  return field;
}

TriangleMesh GridMesh(const HeightField& field, double column_spacing, double row_spacing,
                      double exaggeration) {
  TriangleMesh mesh;
  mesh.positions.reserve(field.heights.size());
  mesh.triangles.reserve(size_t(field.rows - 1) * (field.columns - 1) * 2);
  for (uint32_t row = 0; row < field.rows; ++row) {
    for (uint32_t column = 0; column < field.columns; ++column) {
      mesh.positions.push_back(
          {float((column - 0.5 * (field.columns - 1)) * column_spacing),
           float(double(field.heights[size_t(row) * field.columns + column]) * exaggeration),
           float((row - 0.5 * (field.rows - 1)) * row_spacing)});
    }
  }
  for (uint32_t row = 0; row + 1 < field.rows; ++row) {
    for (uint32_t column = 0; column + 1 < field.columns; ++column) {
      const uint32_t a = row * field.columns + column, b = a + 1, c = a + field.columns, d = c + 1;
      mesh.triangles.push_back({a, c, b});
      mesh.triangles.push_back({b, c, d});
    }
  }
  return mesh;
}

void SinCosDegrees(double degrees, double& sine, double& cosine) {
  // Reduced to at most 45 degrees, where the Taylor series to x^17 is exact to double precision.
  const double quarter = std::floor(degrees / 90 + 0.5);
  const double x = (degrees - 90 * quarter) * (3.14159265358979323846 / 180), x2 = x * x;
  double s = 1, c = 1;
  for (int n = 16; n >= 2; n -= 2) {
    s = 1 - x2 / (n * (n + 1)) * s;
    c = 1 - x2 / (n * (n - 1)) * c;
  }
  s *= x;
  switch (int(quarter - 4 * std::floor(quarter / 4))) {
    case 0:
      sine = s;
      cosine = c;
      break;
    case 1:
      sine = c;
      cosine = -s;
      break;
    case 2:
      sine = -s;
      cosine = -c;
      break;
    default:
      sine = -c;
      cosine = s;
      break;
  }
}

TriangleMesh GlobeMesh(const HeightField& field, double exaggeration, const std::string& name) {
  const double north = field.south + field.latitude_step * (field.rows - 1);
  if (field.south != -90 || north != 90 || field.longitude_step * field.columns != 360) {
    throw InputError(
        fmt::format("{}: spans latitudes {} to {} and {} degrees of longitude; -90 to 90 and 360 are needed",
                    name, field.south, north, field.longitude_step * field.columns));
  }
  if (field.rows < 3 || field.columns < 3) throw InputError(name + ": a globe needs 3 x 3 heights at least");
  const auto radius = [&](double height) { return 1 + height * exaggeration / kMeanEarthRadius; };
  const auto pole = [&](uint32_t row) {
    double sum = 0;
    for (uint32_t column = 0; column < field.columns; ++column)
      sum += double(field.heights[size_t(row) * field.columns + column]);
    return radius(sum / field.columns);
  };
  const uint32_t n = field.columns, rings = field.rows - 2;
  TriangleMesh mesh;
  mesh.positions.reserve(size_t(rings) * n + 2);
  mesh.triangles.reserve(size_t(rings) * n * 2);
  mesh.positions.push_back({0, float(-pole(0)), 0});
  for (uint32_t row = 1; row <= rings; ++row) {
    double sin_latitude, cos_latitude;
    SinCosDegrees(field.south + row * field.latitude_step, sin_latitude, cos_latitude);
    for (uint32_t column = 0; column < n; ++column) {
      double sin_longitude, cos_longitude;
      SinCosDegrees(field.west + column * field.longitude_step, sin_longitude, cos_longitude);
      const double r = radius(double(field.heights[size_t(row) * n + column]));
      mesh.positions.push_back({float(r * cos_latitude * cos_longitude), float(r * sin_latitude),
                                float(-r * cos_latitude * sin_longitude)});
    }
  }
  mesh.positions.push_back({0, float(pole(field.rows - 1)), 0});
  const uint32_t last = uint32_t(mesh.positions.size() - 1);
  const auto vertex = [n](uint32_t ring, uint32_t column) { return 1 + ring * n + column % n; };
  for (uint32_t column = 0; column < n; ++column) {
    mesh.triangles.push_back({0, vertex(0, column + 1), vertex(0, column)});
    for (uint32_t ring = 0; ring + 1 < rings; ++ring) {
      const uint32_t a = vertex(ring, column), b = vertex(ring, column + 1), c = vertex(ring + 1, column),
                     d = vertex(ring + 1, column + 1);
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({b, d, c});
    }
    mesh.triangles.push_back({vertex(rings - 1, column), vertex(rings - 1, column + 1), last});
  }
  return mesh;
}

void WriteBinaryPly(const std::filesystem::path& path, const TriangleMesh& mesh) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
      "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
      mesh.positions.size(), mesh.triangles.size());
  bytes.reserve(bytes.size() + mesh.positions.size() * 12 + mesh.triangles.size() * 13);
  const auto append = [&](uint32_t value) {
    for (int shift = 0; shift < 32; shift += 8) bytes += char(value >> shift & 0xff);
  };
  for (const Vec3f& p : mesh.positions)
    for (const float x : {p.x, p.y, p.z}) append(std::bit_cast<uint32_t>(x));
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    bytes += char(3);
    for (const uint32_t index : triangle) append(index);
  }
  WriteFileAtomically(path, bytes);
}

}  // namespace raybench
