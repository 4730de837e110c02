#include "harness/base/row.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace raybench {
namespace {

bool IsOfType(const Json& value, ColumnType type) {
  switch (type) {
    case ColumnType::kText:
      return value.is_string();
    case ColumnType::kCount:
      return value.is_number_unsigned();
    case ColumnType::kNumber:
      return value.is_number();
    case ColumnType::kFlag:
      return value.is_number_unsigned() && value.get<uint64_t>() <= 1;
  }
  return false;
}

/// The first key that is none of the columns.
std::optional<std::string> FirstUnknown(const Json& values, std::span<const Column> columns) {
  for (const auto& [key, value] : values.items())
    if (std::none_of(columns.begin(), columns.end(), [&k = key](const Column& c) { return k == c.name; }))
      return key;
  return std::nullopt;
}

}  // namespace

Row::Row(Json values, std::span<const Column> columns) : values_(std::move(values)) {
  if (!values_.is_object()) throw std::invalid_argument("a row is no object");
  if (const auto unknown = FirstUnknown(values_, columns))
    throw std::invalid_argument("there is no column " + *unknown);
  for (const Column& column : columns)
    if (Has(column.name) && !IsOfType(values_.at(column.name), column.type))
      throw std::invalid_argument(fmt::format("column {} is of another type", column.name));
}

Json Row::ToJson(std::span<const Column> columns) const {
  if (const auto unknown = FirstUnknown(values_, columns))
    throw std::logic_error("no such column: " + *unknown);
  Json row;
  for (const Column& column : columns)
    row[column.name] = Has(column.name) ? values_.at(column.name) : Json(nullptr);
  return row;
}

std::string Row::ToCsv(std::span<const Column> columns) const {
  std::vector<std::string> fields;
  const Json row = ToJson(columns);
  for (const Json& value : row) fields.push_back(CsvField(value));
  return fmt::format("{}", fmt::join(fields, ","));
}

std::string CsvHeader(std::span<const Column> columns) {
  std::vector<std::string_view> names;
  for (const Column& column : columns) names.push_back(column.name);
  return fmt::format("{}", fmt::join(names, ","));
}

std::string CsvField(const Json& value) {
  if (value.is_null()) return {};
  if (value.is_number_float()) return fmt::format("{}", value.get<double>());
  if (!value.is_string()) return value.dump();
  const std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

}  // namespace raybench
