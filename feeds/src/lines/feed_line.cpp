// Reads lines of feeds, and turns their values into those of fields.
#include "feed_line.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/terminal.h>

#include "json_scanner.h"

namespace rtsg::feeds {

namespace {

/// The position of the first byte that is no UTF-8, counted from 1; 0 if there is none.
std::size_t firstNotUtf8(std::string_view text) {
    if (std::ranges::all_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x80; })) return 0;
    const std::string clean = asUtf8(text);
    if (clean == text) return 0;
    return 1 + static_cast<std::size_t>(std::ranges::mismatch(text, clean).in1 - text.begin());
}

Result<double> secondsFrom(std::string_view text) {
    double seconds = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), seconds);
    if (problem != std::errc() || end != text.data() + text.size() || !std::isfinite(seconds))
        return fail(fmt::format("t: '{}' is no time in seconds", text.substr(0, 40)));
    return seconds;
}

void appendQuoted(std::string& out, std::string_view text) {
    out += '"';
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        out += c;
    }
    out += '"';
}

/// Reads the value of the key `value`: a number, a string, or arrays of these.
class JsonValue {
  public:
    JsonValue(JsonScanner& in, FeedLine& line) : in_(in), line_(line) {}

    bool read() {
        line_.value.clear();
        line_.shape = {};
        line_.shape.json = true;
        if (in_.take('[')) return list(1);
        return scalar();
    }

  private:
    bool scalar() {
        ++line_.shape.count;
        if (!line_.value.empty()) line_.value += ' ';
        if (in_.next() == '"') {
            if (!in_.string(text_)) return false;
            appendQuoted(line_.value, text_);
            return true;
        }
        std::string_view word;
        if (in_.next() == '{') return in_.refuse("an object is no value of a field");
        if (!in_.word(word)) return false;
        if (word == "null") return in_.refuse("null is no value of a field");
        line_.value += word == "true" ? "TRUE" : word == "false" ? "FALSE" : word;
        return true;
    }
    bool list(int depth) {
        line_.shape.depth = std::max(line_.shape.depth, depth);
        if (in_.take(']')) return true;
        std::size_t scalars = 0, lists = 0;
        do {
            if (!in_.take('[')) {
                ++scalars;
                if (!scalar()) return false;
                continue;
            }
            if (depth == 2) return in_.refuse("arrays are nested deeper than values of fields are");
            const std::size_t before = line_.shape.count;
            if (!list(2)) return false;
            const std::size_t row = line_.shape.count - before;
            line_.shape.row = lists++ == 0 || line_.shape.row == row ? row : 0;
        } while (in_.take(','));
        if (scalars > 0 && lists > 0) return in_.refuse("numbers and arrays stand side by side");
        return in_.take(']') || in_.refuse("expected ',' or ']'");
    }

    JsonScanner& in_;
    FeedLine& line_;
    std::string text_;
};

/// Reads the value of one key. Sets `valued` if it is the field's.
bool readKey(JsonScanner& in, const std::string& key, FeedLine& line, bool& valued) {
    if (key == "node") return in.string(line.node);
    if (key == "field") return in.string(line.field);
    if (key == "author") return in.string(line.author);
    if (key == "value") {
        valued = true;
        return JsonValue(in, line).read();
    }
    if (key != "t") return in.skip();
    std::string_view word;
    if (in.next() == '"' || in.next() == '[' || in.next() == '{') return in.refuse("t: expected a number of seconds");
    if (!in.word(word)) return false;
    const Result<double> seconds = secondsFrom(word);
    if (!seconds) return in.refuse(seconds.error().text);
    line.time = *seconds;
    return true;
}

Result<FeedLine> readJson(std::string_view text) {
    JsonScanner in(text);
    FeedLine line;
    std::string key;
    bool valued = false;
    const auto failure = [&](std::string why) {
        in.refuse(std::move(why));
        return std::unexpected(in.problem());
    };
    if (!in.take('{')) return failure("expected '{'");
    if (!in.take('}')) {
        do {
            if (!in.string(key) || !(in.take(':') || in.refuse("expected ':'")) || !readKey(in, key, line, valued))
                return failure({});
        } while (in.take(','));
        if (!in.take('}')) return failure("expected ',' or '}'");
    }
    if (!in.atEnd()) return failure("more follows after the object");
    if (line.node.empty() || line.field.empty() || !valued)
        return failure(fmt::format("there is no \"{}\"", line.node.empty()    ? "node"
                                                         : line.field.empty() ? "field"
                                                                              : "value"));
    return line;
}

/// The cells of a line of CSV.
Result<std::vector<std::string>> cellsOf(std::string_view text) {
    std::vector<std::string> cells(1);
    for (std::size_t i = 0; i < text.size();) {
        if (text[i] == ',') {
            cells.emplace_back();
            ++i;
            continue;
        }
        if (text[i] != '"' || !cells.back().empty()) {
            cells.back() += text[i++];
            continue;
        }
        const std::size_t from = i++;
        for (;; ++i) {
            if (i == text.size())
                return fail("a quoted cell without an end", SourceLocation{1, static_cast<std::uint32_t>(from + 1)});
            if (text[i] == '"' && (i + 1 == text.size() || text[i + 1] != '"')) break;
            if (text[i] == '"') ++i;
            cells.back() += text[i];
        }
        if (++i < text.size() && text[i] != ',')
            return fail("more follows after a quoted cell", SourceLocation{1, static_cast<std::uint32_t>(i + 1)});
    }
    return cells;
}

}  // namespace

bool FeedReader::isHeader(const std::vector<std::string>& cells) {
    constexpr std::pair<std::string_view, Column> kNames[] = {{"t", Column::time},
                                                              {"node", Column::node},
                                                              {"field", Column::field},
                                                              {"value", Column::value},
                                                              {"author", Column::author}};
    std::vector<Column> columns(cells.size(), Column::other);
    for (std::size_t i = 0; i < cells.size(); ++i)
        for (const auto& [name, column] : kNames)
            if (cells[i] == name) columns[i] = column;
    const auto has = [&](Column column) { return std::ranges::find(columns, column) != columns.end(); };
    if (!has(Column::node) || !has(Column::field) || !has(Column::value)) return false;
    columns_ = std::move(columns);
    return true;
}

Result<std::optional<FeedLine>> FeedReader::readCsv(std::string_view text) {
    using enum Column;
    auto cells = cellsOf(text);
    if (!cells) return std::unexpected(cells.error());
    if (isHeader(*cells)) return std::nullopt;
    std::vector<Column> columns = columns_;
    if (columns.empty() && cells->size() == 3) columns = {node, field, value};
    if (columns.empty() && cells->size() == 4) columns = {time, node, field, value};
    if (columns.empty() && cells->size() == 5) columns = {time, node, field, value, author};
    if (columns.size() != cells->size())
        return fail(columns_.empty()
                        ? fmt::format("{} cells: expected [t,]node,field,value[,author], or JSON", cells->size())
                        : fmt::format("{} cells, and the header has {}", cells->size(), columns_.size()));
    FeedLine line;
    for (std::size_t i = 0; i < columns.size(); ++i) {
        std::string& cell = (*cells)[i];
        switch (columns[i]) {
            case node:
                line.node = std::move(cell);
                break;
            case field:
                line.field = std::move(cell);
                break;
            case value:
                line.value = std::move(cell);
                break;
            case author:
                line.author = std::move(cell);
                break;
            case time:
                if (cell.empty()) break;
                if (const Result<double> seconds = secondsFrom(cell))
                    line.time = *seconds;
                else
                    return std::unexpected(seconds.error());
                break;
            case other:
                break;
        }
    }
    if (line.node.empty() || line.field.empty())
        return fail(fmt::format("the {} is empty", line.node.empty() ? "node" : "field"));
    return line;
}

Result<std::optional<FeedLine>> FeedReader::read(std::string_view line) {
    if (line.ends_with('\r')) line.remove_suffix(1);
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == line.npos || line[first] == '#') return std::nullopt;
    if (const std::size_t wrong = firstNotUtf8(line))
        return fail("a byte that is no UTF-8", SourceLocation{1, static_cast<std::uint32_t>(wrong)});
    if (line[first] != '{') return readCsv(line);
    auto read = readJson(line);
    if (!read) return std::unexpected(read.error());
    return std::optional(std::move(*read));
}

Result<Value> valueOf(const FeedLine& line, FieldType type, const CustomType* custom) {
    const FieldTypeInfo& element = info(sf(type));
    if (custom && line.shape.json) {
        if (line.shape.depth > (isMF(type) ? 2 : 1)) return fail("expected " + fieldTypeName(type, custom));
        return parseFieldText(type, isMF(type) ? "[" + line.value + "]" : line.value, TextSyntax::classicVrml, custom);
    }
    if (sf(type) == FieldType::SFNode) return fail("nodes cannot be sent by a feed");
    if (!line.shape.json) {
        if (type == FieldType::SFString && !line.value.starts_with('"')) return Value(String(line.value));
        const bool bare = isMF(type) && line.value.find('[') == std::string::npos;
        // A cell is the text of one value, in quotes or not, as an attribute in XML is.
        const TextSyntax syntax = custom && !isMF(type) ? TextSyntax::xml : TextSyntax::classicVrml;
        return parseFieldText(type, bare ? "[" + line.value + "]" : line.value, syntax, custom);
    }
    const FeedLine::Shape& shape = line.shape;
    const std::size_t count = std::max<std::size_t>(element.components, 1);  // a string counts as one
    const bool image = sf(type) == FieldType::SFImage;
    const auto wrong = [&] {
        return fail(fmt::format("expected {}, not {}", info(type).name,
                                shape.depth == 0   ? "a single value"
                                : shape.depth == 1 ? fmt::format("an array of {}", shape.count)
                                                   : fmt::format("arrays with {} values in all", shape.count)));
    };
    if (!isMF(type)) {
        if (image ? shape.depth != 1 : shape.depth != (count > 1 ? 1 : 0) || shape.count != count) return wrong();
        return parseFieldText(type, line.value);
    }
    const bool flat = shape.depth == 1 && !image && shape.count % count == 0;
    const bool rows = shape.depth == 2 && (image || (count > 1 && shape.row == count));
    if (!flat && !rows) return wrong();
    return parseFieldText(type, "[" + line.value + "]");
}

}  // namespace rtsg::feeds
