// Lists nodes and names of a document, and indents it.
#include "outline.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/documents/read_document.h>

#include "document_words.h"

namespace rtsg::editor {

namespace {

constexpr std::size_t kFewNodes = 2000;
constexpr std::size_t kMaxSymbols = 50'000;

TextRange partOf(std::string_view text, std::string_view part) {
    const auto begin = static_cast<std::size_t>(part.data() - text.data());
    return {begin, begin + part.size()};
}

bool isName(WordKind kind) {
    return kind == WordKind::definition || kind == WordKind::use;
}
bool isOfProto(WordKind kind) {
    return kind == WordKind::proto || kind == WordKind::protoUse || kind == WordKind::nodeType;
}

/// The words that are the same name as the one at the offset: it, and the others.
std::vector<const Word*> sameName(const DocumentWords& words, std::string_view text, std::size_t offset) {
    const auto isHere = [&](const Word& word) {
        const TextRange range = partOf(text, word.text);
        return range.begin <= offset && offset <= range.end && (isName(word.kind) || isOfProto(word.kind));
    };
    const auto found = std::ranges::find_if(words.words, isHere);
    if (found == words.words.end() || found->text.empty()) return {};
    // Types that the document does not declare have no name to change.
    if (!isName(found->kind) && std::ranges::find(words.protos, found->text, &WordProto::name) == words.protos.end())
        return {};
    std::vector<const Word*> all;
    for (const Word& one : words.words) {
        const bool isAlike = isName(found->kind) ? isName(one.kind) && one.scope == found->scope : isOfProto(one.kind);
        if (isAlike && one.text == found->text) all.push_back(&one);
    }
    return all;
}

/// Whether both encodings can spell it.
bool canBeName(std::string_view name) {
    static constexpr std::string_view kKeywords[] = {
        "DEF", "USE", "TO", "IS", "AS", "NULL", "TRUE", "FALSE", "ROUTE", "PROTO", "IMPORT", "EXPORT", "EXTERNPROTO"};
    constexpr std::string_view kForbidden = "\"'#,.[]{}\\<>&:/=";
    if (name.empty() || std::ranges::find(kKeywords, name) != std::end(kKeywords)) return false;
    const char first = name.front();
    if ((first >= '0' && first <= '9') || first == '-' || first == '+') return false;
    return std::ranges::none_of(
        name, [&](char c) { return (c >= 0 && c <= ' ') || c == 0x7F || kForbidden.find(c) != kForbidden.npos; });
}

// ---- indentation ---------------------------------------------------------------------------------------------------

/// Follows the brackets of ClassicVRML and JSON, or the elements of XML, from line to line.
class Indenter {
  public:
    Indenter(std::string_view text, std::string_view unit) : text_(text), unit_(unit) {
        const Encoding encoding = detectEncoding(text.substr(0, 4096));
        isXml_ = encoding == Encoding::xml;
        hasComments_ = encoding != Encoding::json;
    }

    std::vector<Indentation> take() {
        while (at_ < text_.size()) {
            line();
            const std::size_t end = std::min(text_.find('\n', at_), text_.size());
            while (at_ < end) isXml_ ? element(end) : bracket(end);
            at_ = end + 1;
        }
        return std::move(result_);
    }

  private:
    void line() {
        const std::size_t first = std::min(text_.find_first_not_of(" \t", at_), text_.size());
        const bool isBlank = first == text_.size() || text_[first] == '\n' || text_[first] == '\r';
        if (isWithin()) return;
        if (isXml_ && !isInTag_ && !isBlank && text_[first] != '<') return;  // the text of an element
        std::string with;
        if (!isBlank)
            for (std::size_t i = 0; i < depthAt(first); ++i) with += unit_;
        if (text_.substr(at_, first - at_) != with) result_.push_back({{at_, first}, std::move(with)});
    }
    bool isWithin() const { return quote_ != 0 || !until_.empty(); }
    /// Lines that begin by closing something stand where it was opened.
    std::size_t depthAt(std::size_t first) const {
        std::size_t closed = 0;
        if (isXml_)
            closed = text_.substr(first).starts_with("</") ? 1 : 0;
        else
            for (; first < text_.size() && std::string_view("}] \t,").find(text_[first]) != std::string_view::npos;
                 ++first)
                closed += text_[first] == '}' || text_[first] == ']';
        return depth_ + (isInTag_ ? 1 : 0) - std::min(closed, depth_);
    }

    void bracket(std::size_t end) {
        const char c = text_[at_++];
        if (quote_ != 0) {
            if (c == '\\')
                ++at_;
            else if (c == quote_)
                quote_ = 0;
        } else if (c == '"') {
            quote_ = c;
        } else if (c == '#' && hasComments_) {
            at_ = end;
        } else if (c == '{' || c == '[') {
            ++depth_;
        } else if ((c == '}' || c == ']') && depth_ > 0) {
            --depth_;
        }
    }

    void element(std::size_t end) {
        if (!until_.empty()) {
            const std::size_t found = text_.substr(0, end).find(until_, at_);
            at_ = found == text_.npos ? end : found + until_.size();
            if (found != text_.npos) until_ = {};
            return;
        }
        const char c = text_[at_++];
        if (quote_ != 0) {
            if (c == quote_) quote_ = 0;
        } else if (isInTag_) {
            if (c == '\'' || c == '"') quote_ = c;
            if (c != '>') return;
            isInTag_ = false;
            const bool isWhole = text_[at_ - 2] == '/';
            if (isClosing_)
                depth_ -= depth_ > 0;
            else if (!isWhole)
                ++depth_;
        } else if (c == '<') {
            const std::string_view rest = text_.substr(at_);
            until_ = rest.starts_with("!--")        ? "-->"
                     : rest.starts_with("![CDATA[") ? "]]>"
                     : rest.starts_with("?")        ? "?>"
                     : rest.starts_with("!")        ? ">"
                                                    : "";
            isInTag_ = until_.empty();
            isClosing_ = rest.starts_with('/');
        }
    }

    const std::string_view text_, unit_;
    bool isXml_ = false, hasComments_ = true, isInTag_ = false, isClosing_ = false;
    std::size_t at_ = 0, depth_ = 0;
    char quote_ = 0;          // of the text that is open
    std::string_view until_;  // the end of the comment, or of what is like one
    std::vector<Indentation> result_;
};

}  // namespace

std::vector<Symbol> outlineOf(std::string_view text) {
    const DocumentWords words = wordsOf(text);
    const bool areFew = words.nodes.size() <= kFewNodes;
    std::vector<Symbol> all;
    std::vector<std::size_t> ofProto(words.protos.size(), kNoNode), ofNode(words.nodes.size(), kNoNode);
    const auto add = [&](Symbol symbol, std::size_t end) {
        symbol.all = {symbol.word.begin, end == kNoNode ? text.size() : std::max(end, symbol.word.end)};
        all.push_back(std::move(symbol));
        return all.size() - 1;
    };
    std::size_t proto = 0;
    const auto addProto = [&] {
        const WordProto& one = words.protos[proto];
        const std::size_t around = one.scope == kNoNode ? kNoNode : ofProto[one.scope];
        ofProto[proto++] = add({std::string(one.name), "PROTO", true, {}, partOf(text, one.name), around}, one.end);
    };
    for (std::size_t i = 0; i < words.nodes.size() && all.size() < kMaxSymbols; ++i) {
        const WordNode& node = words.nodes[i];
        while (proto < words.protos.size() && words.protos[proto].name.data() < node.type.data()) addProto();
        // What is not listed itself passes on what it hangs in.
        const std::size_t around = node.parent != kNoNode  ? ofNode[node.parent]
                                   : node.scope != kNoNode ? ofProto[node.scope]
                                                           : kNoNode;
        if (!areFew && node.def.empty()) {
            ofNode[i] = around;
            continue;
        }
        const TextRange word = partOf(text, node.def.empty() ? node.type : node.def);
        ofNode[i] = add({std::string(node.def.empty() ? node.type : node.def),
                         node.def.empty() ? std::string(node.field) : std::string(node.type),
                         false,
                         {},
                         word,
                         around},
                        node.end);
    }
    while (proto < words.protos.size() && all.size() < kMaxSymbols) addProto();
    return all;
}

std::vector<TextRange> referencesAt(std::string_view text, std::size_t offset, bool withDefinitions) {
    const DocumentWords words = wordsOf(text);
    std::vector<TextRange> all;
    for (const Word* one : sameName(words, text, offset))
        if (withDefinitions || (one->kind != WordKind::definition && one->kind != WordKind::proto))
            all.push_back(partOf(text, one->text));
    return all;
}

TextRange renamableAt(std::string_view text, std::size_t offset) {
    for (const TextRange& one : referencesAt(text, offset, true))
        if (one.begin <= offset && offset <= one.end) return one;
    return {};
}

Result<std::vector<TextRange>> renamed(std::string_view text, std::size_t offset, std::string_view to) {
    const DiagnosticCode code("editor");
    const DocumentWords words = wordsOf(text);
    const std::vector<const Word*> all = sameName(words, text, offset);
    if (all.empty()) return fail(code, "no name of a node or of a prototype stands here");
    if (!canBeName(to)) return fail(code, fmt::format("'{}' is no name in every encoding", to));
    for (const Word& one : words.words) {
        const bool isTaken = isName(all.front()->kind)
                                 ? one.kind == WordKind::definition && one.scope == all.front()->scope
                                 : one.kind == WordKind::proto;
        if (isTaken && one.text == to && to != all.front()->text)
            return fail(code, fmt::format("{} is there already", to));
    }
    std::vector<TextRange> ranges;
    for (const Word* one : all) ranges.push_back(partOf(text, one->text));
    return ranges;
}

std::vector<Indentation> indentationOf(std::string_view text, std::string_view unit) {
    return Indenter(text, unit).take();
}

}  // namespace rtsg::editor
