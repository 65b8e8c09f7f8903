// Parses values of custom field types: their own text in quotes, or their numbers.
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "field_text_parser.h"
#include "number_text.h"

namespace rtsg::detail {

namespace {

using Of = CustomLayout::Of;
constexpr std::size_t kReportedEach = 512;  // values between two words on progress

/// For a trial, of which nobody hears.
class SilentReport final : public FieldTextReport {
  public:
    void report(Severity, const char*, std::string) override { failed = true; }
    bool failed = false;
};

int digitOf(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

}  // namespace

template <class S>
bool FieldTextParser::parseCustomNumbers(const CustomType& custom, std::vector<double>& numbers) {
    bool finite = true;
    for (std::size_t i = 0; i < custom.layout().count; ++i) {
        skipSpace();
        const char* at = p;
        S number{};
        NumberStatus status = p == end_ ? NumberStatus::malformed : scanNumber(p, end_, number);
        while (p == end_ && grow()) status = scanNumber(p = at, end_, number);
        if (status == NumberStatus::malformed) {
            p = at;
            const std::string what = std::to_string(custom.layout().count) +
                                     (std::is_same_v<S, std::int32_t> ? " integers" : " numbers") +
                                     (hasCustomText(custom) ? ", or a text in double quotes" : "");
            return expected((what + " (SF" + std::string(custom.name()) + ")").c_str());
        }
        if (status == NumberStatus::notFinite && finite) {
            report_.report(Severity::error, at, "the number is not finite or too large for its type");
            finite = false;
        }
        numbers.push_back(static_cast<double>(number));
    }
    return finite;
}

bool FieldTextParser::parseHexadecimal(const CustomType& custom, std::string& bits) {
    skipSpace();
    const char* const start = p;
    const char* const stop = wordEnd();
    std::string_view word(p, static_cast<std::size_t>(stop - p));
    bool good = word.starts_with("0x") && word.size() % 2 == 0;
    if (good) word.remove_prefix(2);
    for (std::size_t i = 0; good && i < word.size(); i += 2) {
        const int high = digitOf(word[i]), low = digitOf(word[i + 1]);
        good = high >= 0 && low >= 0;
        bits += static_cast<char>(high << 4 | low);
    }
    if (!good) {
        p = start;
        return expected(("0x and two digits for each byte (SF" + std::string(custom.name()) + ")").c_str());
    }
    p = stop;
    return true;
}

/// Without a text of its own: numbers, or bytes.
bool FieldTextParser::parseCustomBare(const CustomType& custom, CustomValue& out) {
    std::vector<double> numbers;
    std::string bits;
    skipSpace();
    const char* const at = p;
    bool usable = false;
    switch (custom.layout().of) {
        case Of::bytes:
            usable = parseHexadecimal(custom, bits);
            break;
        case Of::int32:
            usable = parseCustomNumbers<std::int32_t>(custom, numbers);
            break;
        case Of::float32:
            usable = parseCustomNumbers<float>(custom, numbers);
            break;
        case Of::float64:
            usable = parseCustomNumbers<double>(custom, numbers);
            break;
    }
    if (!usable) return false;
    auto created =
        custom.layout().of == Of::bytes ? custom.value(std::as_bytes(std::span(bits))) : custom.value(numbers);
    if (created) created = normalisedCustom(custom, std::move(*created));
    if (!created) {
        report_.report(Severity::error, at, created.error().text);
        p = at;
        return false;
    }
    out = std::move(*created);
    return true;
}

bool FieldTextParser::parseCustomElement(const CustomType& custom, CustomValue& out) {
    skipSpace();
    if (p == end_ || *p != '"') return parseCustomBare(custom, out);
    const char* const at = p;
    String quoted;
    if (!parseQuoted(quoted)) return false;
    auto created = customFromText(custom, quoted);
    if (!created) {
        // JSON has bytes in this form, since it does not know their text.
        SilentReport silent;
        const std::string_view text = quoted;
        FieldTextParser trial(text.data(), text.data() + text.size(), TextSyntax::xml, silent);
        if (trial.parseCustomBare(custom, out) && trial.p == trial.end_ && !silent.failed) return true;
        report_.report(Severity::error, at, created.error().text);
        p = at;
        return false;
    }
    out = std::move(*created);
    return true;
}

bool FieldTextParser::parseCustom(FieldType type, const CustomType& custom, Value& out) {
    const bool xml = syntax_ == TextSyntax::xml;
    skipSpace();
    if (!isMF(type)) {
        CustomValue one;
        bool usable = false;
        if (xml && p != end_ && *p != '"' && hasCustomText(custom)) {
            // An attribute is a text of its own, unless it is numbers.
            std::string_view text(p, static_cast<std::size_t>(end_ - p));
            SilentReport silent;
            FieldTextParser trial(p, end_, syntax_, silent);
            usable = trial.parseCustomBare(custom, one) && !silent.failed;
            trial.skipSpace();
            if (usable && trial.p == end_) {
                p = end_;
                out = Value(std::move(one));
                return true;
            }
            while (text.ends_with(' ')) text.remove_suffix(1);
            auto created = customFromText(custom, text);
            if (!created) report_.report(Severity::error, p, created.error().text);
            if (created) out = Value(std::move(*created));
            p = end_;
            return created.has_value();
        }
        usable = parseCustomElement(custom, one);
        if (usable) out = Value(std::move(one));
        if (xml) {
            skipSpace();
            if (usable && p != end_)
                report_.report(Severity::error, p,
                               "there is more than one SF" + std::string(custom.name()) + ": " + found(p));
            p = end_;
        }
        return usable;
    }
    Array<CustomValue> many;
    const bool bracketed = p != end_ && *p == '[' && !xml;
    if (bracketed) ++p;
    CustomValue one;
    if (!bracketed && !xml) {
        if (!parseCustomElement(custom, one)) return false;
        many.push_back(std::move(one));
        out = Value(std::move(many));
        return true;
    }
    for (;;) {
        skipSpace();
        if (p == end_) {
            if (bracketed) report_.report(Severity::error, p, "']' is missing at the end");
            break;
        }
        if (bracketed && *p == ']') {
            ++p;
            break;
        }
        if (!parseCustomElement(custom, one)) {
            if (bracketed && p != end_) abandonArray();
            break;
        }
        many.push_back(one);
        if (many.size() % kReportedEach == 0) report_.progress(p);
    }
    if (xml) p = end_;
    out = Value(std::move(many));
    return true;
}

}  // namespace rtsg::detail
