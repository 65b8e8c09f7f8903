// Expected failures: a position, a severity and a sentence. Bad input never throws; it ends up here.
//
// Line and column count from 1; 0 means "no position". Printed as `file:line:col: error: text`. Threading: values.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

namespace rtsg {

struct SourceLocation {
    std::uint32_t line = 0;
    std::uint32_t column = 0;
};

enum class Severity : std::uint8_t { note, warning, error };

struct Diagnostic {
    Severity severity = Severity::error;
    std::string file;
    SourceLocation where;
    std::string text;
    std::string format() const;
};

/// Collects diagnostics; past `limit` of them it only counts, so that garbage cannot fill the memory.
class Diagnostics {
  public:
    explicit Diagnostics(std::string file = {}, std::size_t limit = 1000) : file_(std::move(file)), limit_(limit) {}
    void add(Severity severity, SourceLocation where, std::string text);
    void error(SourceLocation where, std::string text) { add(Severity::error, where, std::move(text)); }
    void warning(SourceLocation where, std::string text) { add(Severity::warning, where, std::move(text)); }
    /// Appends another collection as it is (an Inline's, say).
    void append(const Diagnostics& other);

    const std::vector<Diagnostic>& all() const { return all_; }
    std::size_t errors() const { return errors_; }
    std::size_t warnings() const { return warnings_; }
    /// Those counted but not kept.
    std::size_t dropped() const { return dropped_; }
    const std::string& file() const { return file_; }
    void setFile(std::string file) { file_ = std::move(file); }

  private:
    std::string file_;
    std::size_t limit_;
    std::vector<Diagnostic> all_;
    std::size_t errors_ = 0, warnings_ = 0, dropped_ = 0;
};

template <class T = void>
using Result = std::expected<T, Diagnostic>;

/// `return fail("no such node");`
inline std::unexpected<Diagnostic> fail(std::string text, SourceLocation where = {}, std::string file = {}) {
    return std::unexpected(Diagnostic{Severity::error, std::move(file), where, std::move(text)});
}

}  // namespace rtsg
