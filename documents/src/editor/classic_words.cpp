// Finds the roles of the words in a ClassicVRML text, complete or not.
#include <algorithm>
#include <iterator>
#include <utility>

#include <rtsg/core/node_type.h>
#include <rtsg/documents/read_document.h>

#include "document_words.h"

namespace rtsg::editor {

namespace {

constexpr std::string_view kEndsWords = " \t\r\n,\"#{}[]";

/// Keywords are no names: if one comes, the earlier statement is incomplete.
bool isKeyword(std::string_view word) {
    return word == "DEF" || word == "USE" || word == "ROUTE" || word == "PROTO" || word == "EXTERNPROTO";
}

class ClassicWords {
  public:
    explicit ClassicWords(std::string_view text) : text_(text) { levels_.push_back({}); }

    DocumentWords take() {
        while (at_ < text_.size()) {
            const std::size_t known = result_.words.size();
            step();
            for (std::size_t i = known; i < result_.words.size(); ++i) result_.words[i].scope = levels_.back().scope;
        }
        if (!isInWord_) report({});
        return std::move(result_);
    }

  private:
    using Expects = WordsEnd::Expects;
    /// A level of nesting: the text between two brackets, or the document itself.
    struct Level {
        char bracket = 0;  // 0: the document, or a PROTO's body
        std::size_t node = kNoNode;
        std::string_view field{};    // of the list
        bool isInterface = false;    // of a PROTO or EXTERNPROTO
        std::string_view waiting{};  // a field's name whose value has not come
        std::size_t scope = kNoNode;
        std::size_t ends = kNoNode;  // the node that ends with it
        bool isBody = false;         // of the last prototype of its scope
    };

    void step() {
        const char c = text_[at_];
        isInWord_ = false;
        if (c == '#') {
            at_ = std::min(text_.find('\n', at_), text_.size());
            isInWord_ = at_ == text_.size();  // nothing is expected in a comment
        } else if (c == '"') {
            string();
        } else if (c == '{' || c == '[') {
            open(c);
        } else if (c == '}' || c == ']') {
            close(c);
        } else if (kEndsWords.contains(c)) {
            ++at_;
        } else {
            word();
        }
    }

    void string() {
        std::size_t end = at_ + 1;
        while (end < text_.size() && text_[end] != '"') end += text_[end] == '\\' ? 2 : 1;
        end = std::min(end, text_.size());
        Level& level = levels_.back();
        const std::string_view inside = text_.substr(at_ + 1, end - at_ - 1);
        const std::string_view field = level.bracket == '[' ? level.field : level.waiting;
        result_.words.push_back({WordKind::value, inside, level.node, field});
        if (end == text_.size()) {
            isInWord_ = true;
            result_.end = {Expects::value, inside, level.node, field};
        }
        at_ = std::min(end + 1, text_.size());
        if (level.bracket != '[') level.waiting = {};
        pending_ = {};
    }

    void open(char bracket) {
        ++at_;
        if (levels_.size() >= kDeepestWord) return void(++skipped_);
        Level& level = levels_.back();
        Level next{bracket, level.node, {}, false, {}, level.scope};
        if (bracket == '{') {
            if (opening_ != kNoNode)
                next.node = next.ends = opening_;
            else
                next.bracket = 0, next.node = kNoNode, next.isBody = true;  // a PROTO's body
            if (next.isBody && declaring_ != kNoNode) next.scope = std::exchange(declaring_, kNoNode);
        } else if (isProto_) {
            next.isInterface = true;
        } else {
            next.field = level.bracket == '[' ? level.field : level.waiting;
        }
        opening_ = kNoNode;
        isProto_ = false;
        pending_ = {};
        levels_.push_back(next);
    }
    void close(char bracket) {
        ++at_;
        pending_ = {};
        if (skipped_ > 0) return void(--skipped_);
        const char opens = bracket == '}' ? '{' : '[';
        // A closing bracket closes the innermost open level, unless somebody is about to type a bracket in between.
        while (levels_.size() > 1) {
            const bool fits = levels_.back().bracket == opens || (levels_.back().bracket == 0 && bracket == '}');
            if (!fits && opens == '[') return;
            if (levels_.back().ends != kNoNode) result_.nodes[levels_.back().ends].end = at_;
            if (levels_.back().isBody && levels_.back().scope != kNoNode)
                result_.protos[levels_.back().scope].end = at_;
            levels_.pop_back();
            if (fits) break;
        }
        levels_.back().waiting = {};
    }

    /// The role that the next word would have.
    WordsEnd expected() const {
        const Level& level = levels_.back();
        if (pending_ == "DEF" || pending_ == "PROTO" || pending_ == "EXTERNPROTO") return {};
        if (pending_ == "USE") return {Expects::use, {}, level.node, {}};
        if (pending_ == "ROUTE" || pending_ == "TO") return {Expects::use, {}, kNoNode, {}};
        if (pending_ == "defined") return {Expects::nodeType, {}, level.node, fieldHere(level)};
        if (!pending_.empty() || skipped_ > 0) return {};
        if (level.isInterface) return {};
        const std::string_view field = fieldHere(level);
        if (level.bracket == '{' && (level.waiting.empty() || (hasValue(field) && last_ != "IS")))
            return {Expects::field, {}, level.node, {}};
        if (level.node == kNoNode || holdsNodes(level.node, field)) return {Expects::nodeType, {}, level.node, field};
        return {Expects::value, {}, level.node, field};
    }
    static std::string_view fieldHere(const Level& level) { return level.bracket == '[' ? level.field : level.waiting; }
    bool hasValue(std::string_view field) const {
        return !result_.words.empty() && result_.words.back().kind == WordKind::value &&
               result_.words.back().field.data() == field.data();
    }
    bool holdsNodes(std::size_t node, std::string_view field) const {
        const NodeType* type = findBuiltinType(result_.nodes[node].type);
        const FieldIndex index = type ? type->find(field) : kNoField;
        return index != kNoField && sf(type->fields[index].type) == FieldType::SFNode;
    }
    void report(std::string_view begun) {
        result_.end = expected();
        result_.end.begun = begun;
    }

    void word() {
        const std::size_t end = std::min(text_.find_first_of(kEndsWords, at_), text_.size());
        const std::string_view word = text_.substr(at_, end - at_);
        at_ = end;
        if (end == text_.size()) {
            isInWord_ = true;
            const std::size_t dot = word.find('.');
            if ((pending_ == "ROUTE" || pending_ == "TO") && dot != word.npos)
                result_.end = {Expects::routeField, word.substr(dot + 1), kNoNode, word.substr(0, dot)};
            else
                report(word);
        }
        understand(word);
    }

    void understand(std::string_view word) {
        Level& level = levels_.back();
        const auto add = [&](WordKind kind, std::string_view text, std::string_view field = {}) {
            result_.words.push_back({kind, text, level.node, field});
        };
        const std::string_view before = isKeyword(word) ? std::string_view() : pending_;
        pending_ = {};
        if (before == "DEF") {
            add(WordKind::definition, word);
            def_ = word;
            pending_ = "defined";
        } else if (before == "USE") {
            add(WordKind::use, word);
            if (level.bracket != '[') level.waiting = {};
        } else if (before == "PROTO" || before == "EXTERNPROTO") {
            add(WordKind::proto, word);
            declaring_ = before == "PROTO" ? result_.protos.size() : kNoNode;
            result_.protos.push_back({word, {}, level.scope});
            isProto_ = true;
        } else if (before == "EXPORT" || before == "IMPORT") {  // NAME [AS NAME], INLINE.NAME [AS NAME]
            add(WordKind::use,
                word.substr(0, before == "EXPORT" ? word.size() : std::min(word.find('.'), word.size())));
            pending_ = before == "IMPORT" ? "imported" : "exported";
        } else if (before == "imported" || before == "exported") {
            pending_ = word != "AS" ? "" : before == "imported" ? "importedAs" : "exportedAs";
            if (pending_.empty()) understand(word);
        } else if (before == "importedAs") {
            add(WordKind::definition, word);
        } else if (before == "exportedAs") {
            add(WordKind::attribute, word);
        } else if (before == "ROUTE" || before == "TO") {
            const std::size_t dot = std::min(word.find('.'), word.size());
            add(WordKind::use, word.substr(0, dot));
            if (dot < word.size()) add(WordKind::routeField, word.substr(dot + 1), word.substr(0, dot));
            if (before == "ROUTE") pending_ = "routed";
        } else if (before == "routed") {
            pending_ = word == "TO" ? "TO" : "";
        } else if (before == "defined") {
            node(word);
        } else if (isKeyword(word)) {
            pending_ = word;
        } else if (level.isInterface || skipped_ > 0) {
            add(WordKind::attribute, word);
            if (level.isInterface) declare(word);
        } else if (level.bracket == '{' && level.waiting.empty()) {
            add(WordKind::field, word);
            level.waiting = word;
            result_.nodes[level.node].given.push_back(word);
        } else {
            nodeOrValue(word);
        }
    }

    /// A word of a PROTO's interface: access, type, name, then a value that means nothing here.
    void declare(std::string_view word) {
        static constexpr std::string_view kAccess[] = {"inputOnly", "outputOnly", "inputOutput",  "initializeOnly",
                                                       "eventIn",   "eventOut",   "exposedField", "field"};
        if (std::ranges::find(kAccess, word) != std::end(kAccess)) {
            declared_ = {word, {}, {}};
        } else if (!declared_.access.empty() && declared_.type.empty()) {
            declared_.type = word;
        } else if (!declared_.access.empty() && !result_.protos.empty()) {
            declared_.name = word;
            result_.protos.back().fields.push_back(std::exchange(declared_, {}));
        }
    }

    void nodeOrValue(std::string_view word) {
        Level& level = levels_.back();
        const std::string_view field = fieldHere(level);
        const std::size_t next = text_.find_first_not_of(" \t\r\n,", at_);
        const bool opens = next != text_.npos && text_[next] == '{';
        if (opens || (level.node != kNoNode && holdsNodes(level.node, field) && word != "NULL")) return node(word);
        if (level.node == kNoNode) {  // a statement of the head, whose own words are no nodes
            static constexpr std::string_view kHead[] = {"PROFILE", "COMPONENT", "META", "UNIT"};
            if (word == "IMPORT" || word == "EXPORT")
                pending_ = word;
            else if (std::ranges::find(kHead, word) != std::end(kHead))
                at_ = std::min(text_.find('\n', at_), text_.size());
            else
                result_.words.push_back({WordKind::nodeType, word});
            return;
        }
        // A value ends where a name begins: of several numbers each goes to the field.
        const char first = word.front();
        const bool isNumber = (first >= '0' && first <= '9') || first == '-' || first == '+' || first == '.';
        const bool isWordValue = word == "TRUE" || word == "FALSE" || word == "NULL" || word == "IS";
        if (level.bracket != '[' && hasValue(field) && !isNumber && last_ != "IS") {
            level.waiting = {};
            return understand(word);
        }
        result_.words.push_back({WordKind::value, word, level.node, field});
        last_ = word;
        if (level.bracket != '[' && isWordValue && word != "IS") level.waiting = {};
    }

    void node(std::string_view type) {
        Level& level = levels_.back();
        const std::string_view field = fieldHere(level);
        result_.words.push_back({WordKind::nodeType, type, level.node, field});
        opening_ = result_.nodes.size();
        result_.nodes.push_back({type, std::exchange(def_, {}), level.node, field, {}, level.scope});
        if (level.bracket != '[') level.waiting = {};
    }

    const std::string_view text_;
    std::size_t at_ = 0;
    DocumentWords result_;
    std::vector<Level> levels_;
    std::size_t skipped_ = 0;
    std::string_view pending_{}, def_{}, last_{};
    WordProto::Field declared_{};
    std::size_t opening_ = kNoNode;    // the node whose brace comes next
    std::size_t declaring_ = kNoNode;  // the PROTO whose body comes next
    bool isProto_ = false, isInWord_ = false;
};

}  // namespace

DocumentWords wordsOfClassic(std::string_view text) {
    return ClassicWords(text).take();
}

DocumentWords wordsOf(std::string_view text) {
    switch (detectEncoding(text.substr(0, 4096))) {
        case Encoding::xml:
            return wordsOfXml(text);
        case Encoding::classicVrml:
        case Encoding::vrml97:
            return wordsOfClassic(text);
        default:
            return {};
    }
}

}  // namespace rtsg::editor
