// Expected failures: a position, a severity, a sentence and a code. Bad input gives one of these and never throws.
//
// Line and column count from 1; 0 means "no position". The printed form is `file:line:col: error: text [code]`. The
// code is a short word that stays the same when the sentence is improved; docs/diagnostics.md lists all codes. A report
// that names no code gets the code of the source file it comes from (the table in diagnostic.cpp). More exact codes are
// given where they are useful. Threading: values.
#pragma once

#include <version>
#ifndef __cpp_lib_expected
#error "RTSG needs C++23 with std::expected: GCC 12 or Clang 19, or newer, and -std=c++23"
#include "there is no such file, which ends the compilation: this error is enough"
#endif

#include <cstddef>
#include <cstdint>
#include <expected>
#include <source_location>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rtsg {

struct SourceLocation {
    std::uint32_t line = 0;
    std::uint32_t column = 0;
};

/// The place in a file from which a node was read.
struct NodeLocation {
    std::string file;  // as messages name it; empty if the node comes from no file
    SourceLocation where;
};

enum class Severity : std::uint8_t { note, warning, error };

/// Names the kind of a failure by a literal of small letters, digits and hyphens, which is checked when it is compiled.
class DiagnosticCode {
  public:
    template <std::size_t N>
    consteval explicit DiagnosticCode(const char (&text)[N]) : text_(text, N - 1) {
        if (N < 3) throw "a code is a word";
        for (const char c : text_)
            if (!((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-')) throw "a code is a-z, 0-9 and '-'";
    }
    /// The code of the source file that reports; `application` outside this project.
    static DiagnosticCode of(std::source_location reporter) noexcept;

    std::string_view text() const { return text_; }
    friend bool operator==(DiagnosticCode, DiagnosticCode) = default;

  private:
    std::string_view text_;
};

struct Diagnostic {
    Severity severity = Severity::error;
    std::string file;
    SourceLocation where;
    std::string text;
    DiagnosticCode code = DiagnosticCode::of(std::source_location::current());
    std::string format() const;
};

/// Collects diagnostics; past `limit` of them it only counts, so that garbage cannot fill the memory.
class Diagnostics {
  public:
    explicit Diagnostics(std::string file = {}, std::size_t limit = 1000) : file_(std::move(file)), limit_(limit) {}
    void add(Severity severity, SourceLocation where, std::string text,
             DiagnosticCode code = DiagnosticCode::of(std::source_location::current()));
    /// Adds the diagnostic unchanged, with its own file. If text and place are those of the last one, it is only
    /// counted.
    void add(Diagnostic diagnostic);
    void error(SourceLocation where, std::string text,
               DiagnosticCode code = DiagnosticCode::of(std::source_location::current())) {
        add(Severity::error, where, std::move(text), code);
    }
    void warning(SourceLocation where, std::string text,
                 DiagnosticCode code = DiagnosticCode::of(std::source_location::current())) {
        add(Severity::warning, where, std::move(text), code);
    }
    /// Adds a warning about a node.
    void warningAt(const NodeLocation& location, std::string text,
                   DiagnosticCode code = DiagnosticCode::of(std::source_location::current())) {
        add(Diagnostic{Severity::warning, location.file.empty() ? file_ : location.file, location.where,
                       std::move(text), code});
    }
    /// Appends another collection unchanged, such as that of an Inline.
    void append(const Diagnostics& other);

    const std::vector<Diagnostic>& all() const { return all_; }
    std::size_t errors() const { return errors_; }
    std::size_t warnings() const { return warnings_; }
    /// How many were counted but not kept.
    std::size_t dropped() const { return dropped_; }
    const std::string& file() const { return file_; }
    void setFile(std::string file) { file_ = std::move(file); }

  private:
    std::string file_;
    std::size_t limit_;
    std::vector<Diagnostic> all_;
    std::size_t errors_ = 0, warnings_ = 0, dropped_ = 0;
};

/// A value, or the reason why there is none. The compiler warns where a result is ignored.
template <class T = void>
class [[nodiscard]] Result : public std::expected<T, Diagnostic> {
  public:
    using std::expected<T, Diagnostic>::expected;
};

/// `return fail(DiagnosticCode("no-such-node"), "no node 7");`
inline std::unexpected<Diagnostic> fail(DiagnosticCode code, std::string text, SourceLocation where = {},
                                        std::string file = {}) {
    return std::unexpected(Diagnostic{Severity::error, std::move(file), where, std::move(text), code});
}

/// `return fail("no such node");`
inline std::unexpected<Diagnostic> fail(std::string text, SourceLocation where = {}, std::string file = {},
                                        std::source_location reporter = std::source_location::current()) {
    return fail(DiagnosticCode::of(reporter), std::move(text), where, std::move(file));
}

}  // namespace rtsg
