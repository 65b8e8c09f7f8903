// Parses one field value at a position in a longer text; the readers' workhorse.
//
// Invariant: linear in the text consumed, memory within a constant of what the text spells out; never reads at or
// behind `end`. Faults are reported once for each value. Threading: one thread a parser; others may help it within a
// long list: NumberPieces. Source: ISO/IEC 19776-1 V3.3 clause 5, 19776-2 V3.3 annex A.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/custom_field.h>
#include <rtsg/core/field_text.h>

#include "number_text.h"
#include "splitting.h"

namespace rtsg::detail {

/// Receives the reports of a value parser; `at` points into the text parsed.
class FieldTextReport {
  public:
    virtual ~FieldTextReport() = default;
    virtual void report(Severity severity, const char* at, std::string text) = 0;
    /// Called every so often inside long values.
    virtual void progress(const char*) {}
    /// The text parsed ends at `end`: where it ends once more of it has come; `end` itself if there is no more.
    virtual const char* more(const char* end) { return end; }
    /// How long lists are read. All that is said here is said by the thread that parses.
    virtual Splitting splitting() const { return {}; }
    /// A comment between or within values, from its # to the end of the line.
    virtual void comment(std::string_view) {}
};

template <class S>
class NumberPieces;

class FieldTextParser {
  public:
    FieldTextParser(const char* begin, const char* end, TextSyntax syntax, FieldTextReport& report)
        : p(begin), end_(end), report_(report), syntax_(syntax) {}

    /// Parses one value and moves behind it. False if there was nothing usable, which has been reported. In
    /// ClassicVRML, `p` is then at the first character that did not fit; XML always takes everything. `custom`: which
    /// type SFCustom and MFCustom are.
    bool parse(FieldType type, Value& out, const CustomType* custom = nullptr);

    /// White space, commas and, in ClassicVRML, comments.
    void skipSpace() {
        for (;;) {
            while (p != end_ && isSpace(*p)) ++p;
            if (p == end_ && grow()) continue;
            if (p == end_ || *p != '#' || syntax_ != TextSyntax::classicVrml) return;
            const char* const start = p;
            do {
                while (p != end_ && *p != '\n' && *p != '\r') ++p;
            } while (p == end_ && grow());
            report_.comment({start, static_cast<std::size_t>(p - start)});
        }
    }
    /// A quoted string; `p` is on the opening quote. False if it never ends (then p is at the end).
    bool parseQuoted(String& out);

    const char* p;

  private:
    /// Asks for more text: a word that touches the end of the text may go on in it, and is then read again.
    bool grow() {
        const char* const before = end_;
        end_ = report_.more(end_);
        return end_ != before;
    }
    const char* wordEnd() {
        const char* stop = endOfWord(p, end_);
        while (stop == end_ && grow()) stop = endOfWord(stop, end_);
        return stop;
    }

    template <class T>
    bool parseOne(T& out);
    template <class T>
    bool parseMany(Array<T>& out);
    template <class T>
    bool parseNumbers(T& out);
    template <class T>
    bool parseManyNumbers(Array<T>& out, bool bracketed);
    template <class S>
    std::unique_ptr<NumberPieces<S>> piecesOf(const char* start, bool bracketed);
    template <class S>
    void readAhead(NumberPieces<S>& pieces);
    bool parseImage(Image& out, bool last);
    bool parseBool(bool& out);
    bool parseCustom(FieldType type, const CustomType& custom, Value& out);
    bool parseCustomElement(const CustomType& custom, CustomValue& out);
    bool parseCustomBare(const CustomType& custom, CustomValue& out);
    template <class S>
    bool parseCustomNumbers(const CustomType& custom, std::vector<double>& numbers);
    bool parseHexadecimal(const CustomType& custom, std::string& bits);
    bool expected(const char* what);
    void closeBracket();
    void abandonArray();
    std::string found(const char* at) const;

    const char* end_;
    FieldTextReport& report_;
    TextSyntax syntax_;
};

}  // namespace rtsg::detail
