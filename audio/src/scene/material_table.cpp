// Reads tables of acoustic materials.
#include <rtsg/audio/material_table.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>

#include <fmt/format.h>

namespace rtsg {
namespace {

constexpr double kUsualScattering = 0.1;

/// A piece of a line, and where it begins: columns count from 1.
struct TableCell {
    std::string_view text;
    std::uint32_t column;
};

std::string_view trimmed(std::string_view text) {
    const auto first = text.find_first_not_of(" \t\r"), last = text.find_last_not_of(" \t\r");
    return first == text.npos ? std::string_view() : text.substr(first, last - first + 1);
}

std::vector<TableCell> cellsOf(std::string_view line, char separator) {
    std::vector<TableCell> cells;
    for (std::size_t at = 0;;) {
        const std::size_t end = std::min(line.find(separator, at), line.size());
        const std::string_view text = trimmed(line.substr(at, end - at));
        const std::size_t begin = text.empty() ? at : static_cast<std::size_t>(text.data() - line.data());
        cells.push_back({text, static_cast<std::uint32_t>(begin + 1)});
        if (end == line.size()) return cells;
        at = end + 1;
    }
}

std::optional<double> numberIn(std::string_view text) {
    double value = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

/// The octave that a mid-frequency names: 31.5, 63, 125, 1000, 1k, "500 Hz".
std::optional<std::size_t> octaveNamed(std::string_view text) {
    if (text.size() > 2 && (text.ends_with("Hz") || text.ends_with("hz")))
        text = trimmed(text.substr(0, text.size() - 2));
    double factor = 1;
    if (text.ends_with('k') || text.ends_with('K')) text.remove_suffix(1), factor = 1000;
    const std::optional<double> hz = numberIn(trimmed(text));
    if (!hz) return std::nullopt;
    for (std::size_t b = 0; b < kBandCount; ++b)
        if (kBandHz[b] == factor * *hz) return b;
    return std::nullopt;
}

/// A column of the table and the kind of its values.
struct TableColumn {
    enum class Kind : std::uint8_t { name, absorption, scattering } kind = Kind::name;
    std::optional<std::size_t> band;  // nothing: all of them
};

std::optional<TableColumn> columnNamed(std::string_view text) {
    constexpr std::string_view kScattering = "scattering", kAbsorption = "absorption";
    using Kind = TableColumn::Kind;
    if (text == "name") return TableColumn{};
    if (text == kScattering) return TableColumn{Kind::scattering, {}};
    if (text == kAbsorption) return TableColumn{Kind::absorption, {}};
    const Kind kind = text.starts_with(kScattering) ? Kind::scattering : Kind::absorption;
    if (text.starts_with(kScattering)) text.remove_prefix(kScattering.size());
    if (text.starts_with(kAbsorption)) text.remove_prefix(kAbsorption.size());
    const auto band = octaveNamed(trimmed(text));
    return band ? std::optional(TableColumn{kind, band}) : std::nullopt;
}

/// Octaves of which some are given; the others have the value of the nearest.
struct GivenBands {
    std::array<std::optional<double>, kBandCount> values;

    void set(std::optional<std::size_t> band, double value) {
        if (band)
            values[*band] = value;
        else
            values.fill(value);
    }
    Bands all(double otherwise) const {
        Bands bands;
        for (int b = 0; b < kBandCount; ++b) {
            double& value = bands[static_cast<std::size_t>(b)] = otherwise;
            int nearest = kBandCount;
            for (int k = 0; k < kBandCount; ++k)
                if (const auto& given = values[static_cast<std::size_t>(k)]; given && std::abs(k - b) < nearest)
                    nearest = std::abs(k - b), value = *given;
        }
        return bands;
    }
};

/// Reads a table line by line.
class TableReader {
  public:
    explicit TableReader(const std::string& file) : file_(file) {}

    Result<> line(std::string_view text, std::uint32_t number) {
        number_ = number;
        text = text.substr(0, text.find('#'));
        if (trimmed(text).empty()) return {};
        if (columns_.empty()) return head(text);
        return row(text);
    }
    bool hasHead() const { return !columns_.empty(); }
    std::map<std::string, MaterialTable::Row, std::less<>> rows;

  private:
    std::unexpected<Diagnostic> wrong(std::string text, std::uint32_t column) const {
        return fail(std::move(text), {number_, column}, file_);
    }

    Result<> head(std::string_view text) {
        separator_ = text.find('\t') != text.npos ? '\t' : text.find(';') != text.npos ? ';' : ',';
        bool absorbs = false, names = false;
        for (const TableCell& cell : cellsOf(text, separator_)) {
            const std::optional<TableColumn> column = columnNamed(cell.text);
            if (!column)
                return wrong(fmt::format("'{}' is no column: there are name, octaves such as 500 or 1k, scattering, "
                                         "and scattering with an octave",
                                         cell.text),
                             cell.column);
            absorbs = absorbs || column->kind == TableColumn::Kind::absorption;
            names = names || column->kind == TableColumn::Kind::name;
            columns_.push_back(*column);
        }
        if (!names) return wrong("no column is called name", 1);
        if (!absorbs) return wrong("no column is an octave of absorption, such as 500", 1);
        return {};
    }

    Result<> row(std::string_view text) {
        const std::vector<TableCell> cells = cellsOf(text, separator_);
        if (cells.size() != columns_.size())
            return wrong(fmt::format("{} values, and there are {} columns", cells.size(), columns_.size()), 1);
        std::string name;
        GivenBands absorption, scattering;
        for (std::size_t i = 0; i < cells.size(); ++i) {
            if (columns_[i].kind == TableColumn::Kind::name) {
                name = std::string(cells[i].text);
                if (name.empty()) return wrong("a material without a name", cells[i].column);
                if (rows.contains(name))
                    return wrong(fmt::format("'{}' is there already, in line {}", name, rows[name].location.where.line),
                                 cells[i].column);
                continue;
            }
            if (cells[i].text.empty()) continue;
            const std::optional<double> value = numberIn(cells[i].text);
            if (!value || !(*value >= 0 && *value <= 1))
                return wrong(fmt::format("'{}' is no share from 0 to 1", cells[i].text), cells[i].column);
            (columns_[i].kind == TableColumn::Kind::scattering ? scattering : absorption).set(columns_[i].band, *value);
        }
        if (std::ranges::none_of(absorption.values, [](const auto& value) { return value.has_value(); }))
            return wrong(fmt::format("'{}' has no absorption", name), 1);
        MaterialTable::Row created{{}, {file_, {number_, 1}}};
        created.material.absorption = absorption.all(0);
        created.material.scattering = scattering.all(kUsualScattering);
        rows.emplace(std::move(name), std::move(created));
        return {};
    }

    std::string file_;
    std::uint32_t number_ = 0;
    char separator_ = ',';
    std::vector<TableColumn> columns_;
};

}  // namespace

Result<MaterialTable> MaterialTable::parse(std::string_view text, const std::string& file) {
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
    if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
    TableReader reader(file);
    std::uint32_t number = 0;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = std::min(text.find('\n', at), text.size());
        if (auto ok = reader.line(text.substr(at, end - at), ++number); !ok) return std::unexpected(ok.error());
        at = end + 1;
    }
    if (reader.rows.empty())
        return fail(reader.hasHead() ? "a table without materials" : "an empty table: its first line names the columns",
                    {}, file);
    MaterialTable table;
    table.rows_ = std::move(reader.rows);
    return table;
}

Result<MaterialTable> MaterialTable::read(const std::filesystem::path& file) {
    constexpr std::uintmax_t kMax = std::uintmax_t{1} << 24;
    std::error_code problem;
    const std::uintmax_t size = std::filesystem::file_size(file, problem);
    if (!problem && size > kMax)
        return fail("this is no table of materials: it has more than 16 MiB", {}, file.string());
    std::ifstream in(file, std::ios::binary);
    std::ostringstream text;
    if (!in || !(text << in.rdbuf())) return fail("cannot be read, or is empty", {}, file.string());
    return parse(text.view(), file.string());
}

const AcousticMaterial* MaterialTable::find(std::string_view name) const {
    const auto row = rows_.find(name);
    return row == rows_.end() ? nullptr : &row->second.material;
}

}  // namespace rtsg
