// FeedLine: what one line of a feed says, in JSON or as CSV.
//
// JSON is an object with `node`, `field` and `value`, perhaps with `t` (seconds) and `author`; other keys are left
// alone. Numbers keep their text, so a value that `rtsg run --watch` printed comes back with the same bits. CSV
// (RFC 4180) has columns `t,node,field,value,author`, or those that a header names; its values are ClassicVRML.
// Threading: values. Source: RFC 8259 (JSON), RFC 4180 (CSV).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/custom_field.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg::feeds {

struct FeedLine {
    std::string node, field, author;
    std::optional<double> time;  // seconds since the start
    std::string value;           // ClassicVRML; of JSON the numbers and strings alone, without brackets
    /// How a value of JSON is nested. Rows of different lengths have `row` 0.
    struct Shape {
        bool json = false;
        int depth = 0;          // of arrays in each other: 0 to 2
        std::size_t count = 0;  // numbers and strings in all
        std::size_t row = 0;    // in each inner array, at depth 2
    } shape;

    /// Memory that it holds, bytes, nearly.
    std::size_t bytes() const {
        return sizeof(*this) + node.capacity() + field.capacity() + author.capacity() + value.capacity();
    }
};

/// The lines of one stream, whose header says what the columns of CSV are.
class FeedReader {
  public:
    /// Nothing for an empty line, a line that begins with '#', and a header. Errors: the fault of the line, and its
    /// column (from 1).
    Result<std::optional<FeedLine>> read(std::string_view line);

  private:
    enum class Column : std::uint8_t { time, node, field, value, author, other };
    Result<std::optional<FeedLine>> readCsv(std::string_view line);
    bool isHeader(const std::vector<std::string>& cells);

    std::vector<Column> columns_;  // empty: those that so many cells have
};

/// The value for a field of this type. Errors: a value of another form; nodes, which no line can name. `custom`: which
/// type SFCustom and MFCustom are.
Result<Value> valueOf(const FeedLine& line, FieldType type, const CustomType* custom = nullptr);

}  // namespace rtsg::feeds
