// Turns the X3D element of a page into XML.
#include "reader_html.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <unordered_map>

#include <rtsg/core/never_destroyed.h>
#include <rtsg/core/node_type.h>

namespace rtsg::detail {

namespace {

std::string lower(std::string_view text) {
    std::string result(text);
    for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return result;
}

bool isHtmlSpace(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\f';
}

bool startsWith(std::string_view text, std::string_view word) {
    return lower(text.substr(0, word.size())) == word;
}

/// The place where the next tag of that name begins, from `from` on; npos if there is none.
std::size_t findTag(std::string_view text, std::string_view tag, std::size_t from) {
    for (std::size_t at = text.find('<', from); at != text.npos; at = text.find('<', at + 1)) {
        if (!startsWith(text.substr(at), tag)) continue;
        const std::size_t end = at + tag.size();
        if (end == text.size() || isHtmlSpace(text[end]) || text[end] == '>' || text[end] == '/') return at;
    }
    return text.npos;
}

/// The names in X3D's spelling, by their lower case.
const std::unordered_map<std::string, std::string>& elementNames() {
    static const auto& names = neverDestroyed([] {
        std::unordered_map<std::string, std::string> result;
        for (const auto& type : builtinTypes()) result.emplace(lower(type->name), type->name);
        for (const char* name : {"X3D", "Scene", "ROUTE", "ProtoDeclare", "ProtoInterface", "ProtoBody",
                                 "ProtoInstance", "ExternProtoDeclare", "IMPORT", "EXPORT", "IS", "connect", "field",
                                 "fieldValue", "head", "meta", "component", "unit"})
            result.emplace(lower(name), name);
        return result;
    });
    return names;
}

std::string attributeName(const NodeType* type, std::string_view given) {
    const std::string plain = lower(given);
    for (const char* name : {"DEF", "USE", "containerField", "fromNode", "fromField", "toNode", "toField", "nodeField",
                             "protoField", "accessType", "appinfo", "documentation", "inlineDEF", "importedDEF",
                             "exportedDEF", "localDEF", "AS", "conversionFactor"})
        if (lower(name) == plain) return name;
    if (type)
        for (const FieldDef& field : type->fields)
            if (!field.hidden && lower(field.name) == plain) return field.name;
    return std::string(given);
}

/// Whether the & at `at` begins a reference that XML has.
bool isReference(std::string_view text, std::size_t at) {
    const std::size_t end = text.find(';', at);
    if (end == text.npos || end - at > 10) return false;
    const std::string_view name = text.substr(at + 1, end - at - 1);
    constexpr std::array<std::string_view, 5> known = {"lt", "gt", "amp", "quot", "apos"};
    return name.starts_with('#') || std::ranges::find(known, name) != known.end();
}

void appendText(std::string& out, std::string_view text) {
    for (std::size_t i = 0; i < text.size(); ++i)
        if (text[i] == '<')
            out += "&lt;";
        else if (text[i] == '\'')
            out += "&apos;";
        else if (text[i] == '&' && !isReference(text, i))
            out += "&amp;";
        else
            out += text[i];
}

class PageReader {
  public:
    explicit PageReader(std::string_view page) : page_(page) {}

    std::string read(std::size_t from) {
        // So that lines have their numbers.
        out_.assign(static_cast<std::size_t>(
                        std::count(page_.begin(), page_.begin() + static_cast<std::ptrdiff_t>(from), '\n')),
                    '\n');
        at_ = from;
        std::size_t depth = 0;
        while (at_ < page_.size()) {
            if (page_[at_] != '<') {
                const std::size_t end = std::min(page_.find('<', at_), page_.size());
                appendText(out_, page_.substr(at_, end - at_));
                at_ = end;
            } else if (page_.substr(at_).starts_with("<!--")) {
                copyThrough("-->");
            } else if (page_.substr(at_).starts_with("<![CDATA[")) {
                copyThrough("]]>");
            } else if (page_.substr(at_).starts_with("</")) {
                endTag();
                if (--depth == 0) break;
            } else if (!startTag()) {
                ++depth;
            } else if (depth == 0) {
                break;  // <x3d/>
            }
        }
        return std::move(out_);
    }
    std::size_t end() const { return at_; }

  private:
    void copyThrough(std::string_view close) {
        const std::size_t found = page_.find(close, at_);
        const std::size_t end = found == page_.npos ? page_.size() : found + close.size();
        out_ += page_.substr(at_, end - at_);
        at_ = end;
    }
    void skipSpace() {
        for (; at_ < page_.size() && isHtmlSpace(page_[at_]); ++at_) out_ += page_[at_];
    }
    std::string_view word() {
        const std::size_t from = at_;
        while (at_ < page_.size() && !isHtmlSpace(page_[at_]) &&
               std::string_view("=>/<").find(page_[at_]) == std::string_view::npos)
            ++at_;
        return page_.substr(from, at_ - from);
    }
    static std::string element(std::string_view given) {
        const auto found = elementNames().find(lower(given));
        return found == elementNames().end() ? std::string(given) : found->second;
    }
    void endTag() {
        at_ += 2;
        out_ += "</" + element(word()) + ">";
        at_ = std::min(page_.find('>', at_), page_.size() - 1) + 1;
    }
    /// True if it is closed at once.
    bool startTag() {
        ++at_;
        const std::string name = element(word());
        const NodeType* type = findBuiltinType(name);
        out_ += "<" + name;
        bool closed = false;
        for (;;) {
            skipSpace();
            if (at_ >= page_.size()) break;
            if (page_[at_] == '>') {
                ++at_;
                break;
            }
            if (page_[at_] == '/') {
                closed = page_.substr(at_).starts_with("/>");
                ++at_;
                continue;
            }
            attribute(type);
        }
        out_ += closed ? "/>" : ">";
        if (name == "Script" && !closed) source();
        return closed;
    }
    void attribute(const NodeType* type) {
        const std::string_view given = word();
        if (given.empty()) {
            ++at_;
            return;
        }
        // Whatever stood before it, in XML there is white space.
        if (!isHtmlSpace(out_.back())) out_ += ' ';
        const std::string name = attributeName(type, given);
        skipSpace();
        out_ += name + "='";
        if (at_ < page_.size() && page_[at_] == '=') {
            ++at_;
            while (at_ < page_.size() && isHtmlSpace(page_[at_])) ++at_;
            const char quote = at_ < page_.size() ? page_[at_] : ' ';
            std::size_t end = 0;
            if (quote == '"' || quote == '\'') {
                ++at_;
                end = std::min(page_.find(quote, at_), page_.size());
            } else {
                for (end = at_; end < page_.size() && !isHtmlSpace(page_[end]) && page_[end] != '>';) ++end;
            }
            appendText(out_, page_.substr(at_, end - at_));
            at_ = std::min(end + (quote == '"' || quote == '\'' ? 1 : 0), page_.size());
        } else {
            out_ += lower(given);
        }
        out_ += '\'';
    }
    /// Reads a script's content, which is no markup.
    void source() {
        std::size_t end = findTag(page_, "</script", at_);
        if (end == page_.npos) end = page_.size();
        const std::string_view text = page_.substr(at_, end - at_);
        // Fields may be declared in front of the source.
        const std::size_t first = text.find_first_not_of(" \t\r\n");
        if (first == text.npos || text[first] == '<') return;
        out_ += "<![CDATA[";
        out_ += text;
        out_ += "]]>";
        at_ = end;
    }

    std::string_view page_;
    std::size_t at_ = 0;
    std::string out_;
};

}  // namespace

bool isHtml(std::string_view head) {
    const std::size_t x3d = std::min(findTag(head, "<x3d", 0), head.size());
    const std::string_view front = head.substr(0, x3d);
    return findTag(front, "<!doctype html", 0) != front.npos || findTag(front, "<html", 0) != front.npos;
}

std::string xmlOfHtml(std::string_view page, Diagnostics& diagnostics) {
    const std::size_t from = findTag(page, "<x3d", 0);
    if (from == page.npos) {
        diagnostics.error({1, 1}, "it is a page without an X3D element", DiagnosticCode("not-a-scene"));
        return {};
    }
    PageReader reader(page);
    std::string result = reader.read(from);
    if (const std::size_t next = findTag(page, "<x3d", reader.end()); next != page.npos) {
        const auto line = static_cast<std::uint32_t>(
            std::count(page.begin(), page.begin() + static_cast<std::ptrdiff_t>(next), '\n') + 1);
        diagnostics.warning({line, 1}, "the page has more than one X3D element; the first one is read");
    }
    return result;
}

}  // namespace rtsg::detail
