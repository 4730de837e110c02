// A row of a result table, column by column, each of its type.
#pragma once

#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "harness/base/json.h"

namespace raybench {

enum class ColumnType {
  kText,
  kCount,   ///< unsigned integer
  kNumber,  ///< double
  kFlag,    ///< 0 or 1
};

struct Column {
  const char* name;
  ColumnType type;
  bool varies;  ///< between runs of the same command and seed: times, measured memory
};

/// A column by name, for Row. Those that there are stand in columns.h.
template <ColumnType kType>
struct ColumnOf {
  const char* name;
};

/// A value that is not set is not available: an empty field.
class Row {
 public:
  /// Takes a value of the column's type, or an optional one (nullopt: not available).
  template <ColumnType kType>
  class Cell {
   public:
    explicit Cell(Json& value) : value_(value) {}
    template <class T>
    void operator=(const T& value) && {
      if constexpr (kType == ColumnType::kText) {
        static_assert(std::convertible_to<T, std::string>, "the column is a text");
        value_ = std::string(value);
      } else if constexpr (kType == ColumnType::kCount) {
        static_assert(std::unsigned_integral<T> && !std::same_as<T, bool>, "the column is a count");
        value_ = uint64_t(value);
      } else if constexpr (kType == ColumnType::kNumber) {
        static_assert(std::floating_point<T>, "the column is a number");
        value_ = double(value);
      } else {
        static_assert(std::same_as<T, bool>, "the column is a flag");
        value_ = value ? 1u : 0u;
      }
    }
    template <class T>
    void operator=(const std::optional<T>& value) && {
      if (value) {
        std::move(*this) = *value;
      } else {
        value_ = nullptr;
      }
    }

   private:
    Json& value_;
  };

  Row() : values_(Json::object()) {}
  /// As read from a file. Throws std::invalid_argument naming a key that `columns` has not, or a value of
  /// another type.
  Row(Json values, std::span<const Column> columns);

  template <ColumnType kType>
  Cell<kType> operator[](ColumnOf<kType> column) {
    return Cell<kType>(values_[column.name]);
  }

  bool Has(std::string_view column) const {
    const auto it = values_.find(column);
    return it != values_.end() && !it->is_null();
  }
  template <ColumnType kType>
  bool Has(ColumnOf<kType> column) const {
    return Has(column.name);
  }
  /// Empty if not available.
  std::string Get(ColumnOf<ColumnType::kText> column) const {
    return Has(column.name) ? values_.at(column.name).get<std::string>() : std::string();
  }
  std::optional<uint64_t> Get(ColumnOf<ColumnType::kCount> column) const { return As<uint64_t>(column.name); }
  std::optional<double> Get(ColumnOf<ColumnType::kNumber> column) const { return As<double>(column.name); }
  std::optional<bool> Get(ColumnOf<ColumnType::kFlag> column) const {
    const auto flag = As<unsigned>(column.name);
    return flag ? std::optional(*flag != 0) : std::nullopt;
  }

  /// Adds what `other` has, in place of its own.
  void Take(const Row& other) { values_.update(other.values_); }

  /// All of `columns` in order, null where not available. Throws std::logic_error for one that is set and not
  /// among them.
  Json ToJson(std::span<const Column> columns) const;
  /// The same as a line of a CSV file, without its end.
  std::string ToCsv(std::span<const Column> columns) const;

 private:
  template <class T>
  std::optional<T> As(const char* column) const {
    if (!Has(column)) return std::nullopt;
    return values_.at(column).get<T>();
  }

  Json values_;
};

/// The first line of a CSV file.
std::string CsvHeader(std::span<const Column> columns);

/// One field as CSV (RFC 4180): text quoted where needed, numbers in the shortest form that reads back the
/// same, null as nothing.
std::string CsvField(const Json& value);

}  // namespace raybench
