// Finds the roles of the words in an XML text, complete or not.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "document_words.h"

namespace rtsg::editor {

namespace {

constexpr std::string_view kSpace = " \t\r\n";
constexpr std::string_view kEndsNames = " \t\r\n<>/='\"";

/// Elements that are no nodes.
constexpr std::array<std::string_view, 18> kStatements = {
    "X3D",     "head",  "Header",       "meta",           "component", "unit",
    "Scene",   "ROUTE", "IMPORT",       "EXPORT",         "field",     "fieldValue",
    "connect", "IS",    "ProtoDeclare", "ProtoInterface", "ProtoBody", "ExternProtoDeclare"};

bool isStatement(std::string_view name) {
    return std::ranges::find(kStatements, name) != kStatements.end();
}

class XmlWords {
  public:
    explicit XmlWords(std::string_view text) : text_(text) {}

    DocumentWords take() {
        while (at_ < text_.size()) {
            const std::size_t open = text_.find('<', at_);
            if (open == text_.npos) break;
            at_ = open + 1;
            if (skip("!--", "-->") || skip("![CDATA[", "]]>") || skip("!", ">") || skip("?", "?>")) continue;
            const std::size_t known = result_.words.size();
            const std::size_t scope = open_.empty() ? kNoNode : open_.back().scope;
            element();
            for (std::size_t i = known; i < result_.words.size(); ++i) result_.words[i].scope = scope;
        }
        return std::move(result_);
    }

  private:
    using Expects = WordsEnd::Expects;
    struct Element {
        std::string_view name;
        std::size_t node = kNoNode;  // its own, or that around it
        std::size_t scope = kNoNode;
        bool isNode = false;
        std::size_t proto = kNoNode;  // that it declares
    };
    /// The attributes of a statement that say what others mean.
    struct Ends {
        std::string_view fromNode{}, toNode{};
    };

    bool skip(std::string_view begin, std::string_view end) {
        if (!text_.substr(at_).starts_with(begin)) return false;
        const std::size_t close = text_.find(end, at_ + begin.size());
        at_ = close == text_.npos ? text_.size() : close + end.size();
        return true;
    }
    bool isAtEnd() const { return at_ >= text_.size(); }
    std::string_view name() {
        const std::size_t end = std::min(text_.find_first_of(kEndsNames, at_), text_.size());
        const std::string_view result = text_.substr(at_, end - at_);
        at_ = end;
        return result;
    }
    std::size_t around() const { return open_.empty() ? kNoNode : open_.back().node; }

    void element() {
        if (!isAtEnd() && text_[at_] == '/') {
            ++at_;
            close(name());
            if (at_ > 0 && text_[at_ - 1] != '>') at_ = std::min(text_.find('>', at_), text_.size() - 1) + 1;
            return;
        }
        const std::string_view type = name();
        if (isAtEnd()) {
            result_.end = {Expects::nodeType, type, around(), {}};
            return;
        }
        const bool isNode = !type.empty() && !isStatement(type);
        Element element{type, around(), open_.empty() ? kNoNode : open_.back().scope, isNode};
        if (type == "ProtoBody" && !open_.empty() && open_.back().proto != kNoNode) element.scope = open_.back().proto;
        const std::size_t protos = result_.protos.size();
        if (isNode) {
            result_.words.push_back(
                {type == "ProtoInstance" ? WordKind::attribute : WordKind::nodeType, type, around()});
            element.node = result_.nodes.size();
            result_.nodes.push_back({type, {}, around(), {}, {}, element.scope});
        }
        const bool isDeclared = type == "field" && !open_.empty() && !result_.protos.empty() &&
                                (open_.back().name == "ProtoInterface" || open_.back().name == "ExternProtoDeclare");
        if (isDeclared) result_.protos.back().fields.emplace_back();
        declared_ = isDeclared ? &result_.protos.back().fields.back() : nullptr;
        const bool isComplete = attributes(element, isNode);
        if (result_.protos.size() > protos) {
            element.proto = protos;
            result_.protos.back().scope = element.scope;
        }
        if (isComplete) end(element);
        if (!isComplete && open_.size() < kDeepestWord)
            open_.push_back(element);
        else if (!isComplete)
            ++skipped_;
    }

    /// A closing tag closes the innermost open element, unless somebody is about to type a tag in between.
    void close(std::string_view type) {
        if (skipped_ > 0) return void(--skipped_);
        const auto found = std::ranges::find(open_.rbegin(), open_.rend(), type, &Element::name);
        if (found == open_.rend()) return;
        at_ = std::min(text_.find('>', at_), text_.size() - 1) + 1;
        for (auto one = open_.rbegin(); one != std::next(found); ++one) end(*one);
        open_.erase(std::next(found).base(), open_.end());
    }
    void end(const Element& element) {
        if (element.isNode) result_.nodes[element.node].end = at_;
        if (element.proto != kNoNode) result_.protos[element.proto].end = at_;
    }

    /// Up to the tag's end. Returns whether the element ends there, too.
    bool attributes(const Element& element, bool isNode) {
        Ends ends;
        const std::size_t tagEnd = std::min(text_.find('>', at_), text_.size());
        // The source of a ROUTE may stand behind the field that it names there.
        for (const auto& [attribute, into] : {std::pair("fromNode", &ends.fromNode), std::pair("toNode", &ends.toNode)})
            if (!isNode) *into = lookAhead(attribute, tagEnd);
        for (;;) {
            const std::size_t next = text_.find_first_not_of(kSpace, at_);
            const bool isSpaced = next != at_;
            at_ = std::min(next, text_.size());
            if (isAtEnd()) {
                if (isSpaced) expectAttribute(element, isNode, {});
                return true;
            }
            if (text_[at_] == '>') return ++at_, false;
            if (text_[at_] == '<') return false;  // the tag was not closed as yet
            if (text_[at_] == '/') return at_ = std::min(text_.find('>', at_), text_.size() - 1) + 1, true;
            const std::string_view attribute = name();
            if (attribute.empty()) {
                ++at_;
                continue;
            }
            if (isAtEnd()) return expectAttribute(element, isNode, attribute), true;
            if (!value(element, isNode, attribute, ends)) return true;
        }
    }
    std::string_view lookAhead(std::string_view attribute, std::size_t tagEnd) const {
        const std::string_view tag = text_.substr(at_, tagEnd - at_);
        const std::size_t found = tag.find(attribute);
        const std::size_t quote = found == tag.npos ? found : tag.find_first_of("'\"", found);
        if (quote == tag.npos) return {};
        const std::size_t end = tag.find(tag[quote], quote + 1);
        return end == tag.npos ? std::string_view() : tag.substr(quote + 1, end - quote - 1);
    }
    void expectAttribute(const Element& element, bool isNode, std::string_view begun) {
        result_.end = {isNode ? Expects::field : Expects::attribute, begun, element.node,
                       isNode ? std::string_view() : element.name};
    }

    /// False: the text ends in it.
    bool value(const Element& element, bool isNode, std::string_view attribute, const Ends& ends) {
        std::size_t at = text_.find_first_not_of(kSpace, at_);
        if (at == text_.npos || text_[at] != '=') return true;  // an attribute without a value
        at = text_.find_first_not_of(kSpace, at + 1);
        if (at == text_.npos || (text_[at] != '\'' && text_[at] != '"')) return at_ = std::min(at, text_.size()), true;
        const std::size_t end = std::min(text_.find(text_[at], at + 1), text_.size());
        const std::string_view inside = text_.substr(at + 1, end - at - 1);
        at_ = std::min(end + 1, text_.size());
        const Meaning meaning = meaningOf(element, isNode, attribute, ends);
        if (end == text_.size()) {
            result_.end = {meaning.expects, inside, element.node, meaning.field};
            return false;
        }
        if (isNode && meaning.kind == WordKind::value) {
            result_.words.push_back({WordKind::field, attribute, element.node});
            result_.nodes[element.node].given.push_back(attribute);
        } else {
            result_.words.push_back({WordKind::attribute, attribute, element.node, element.name});
        }
        result_.words.push_back({meaning.kind, inside, element.node, meaning.field});
        if (meaning.kind == WordKind::proto) result_.protos.push_back({inside});
        if (declared_ && attribute == "name") declared_->name = inside;
        if (declared_ && attribute == "type") declared_->type = inside;
        if (declared_ && attribute == "accessType") declared_->access = inside;
        if (!isNode) return true;
        WordNode& node = result_.nodes[element.node];
        if (attribute == "DEF") node.def = inside;
        if (attribute == "containerField") node.field = inside;
        if (meaning.kind == WordKind::protoUse) node.type = inside;
        return true;
    }

    struct Meaning {
        WordKind kind;
        Expects expects;
        std::string_view field{};
    };
    static Meaning meaningOf(const Element& element, bool isNode, std::string_view attribute, const Ends& ends) {
        if (isNode && attribute == "DEF") return {WordKind::definition, Expects::nothing};
        if (isNode && attribute == "USE") return {WordKind::use, Expects::use};
        if (element.name == "ProtoInstance" && attribute == "name") return {WordKind::protoUse, Expects::nodeType};
        if (isNode && (attribute == "containerField" || attribute == "class"))
            return {WordKind::attribute, Expects::nothing};
        if (isNode) return {WordKind::value, Expects::value, attribute};
        if ((element.name == "ProtoDeclare" || element.name == "ExternProtoDeclare") && attribute == "name")
            return {WordKind::proto, Expects::nothing};
        if (element.name == "fieldValue" && attribute == "name" && element.node != kNoNode)
            return {WordKind::field, Expects::attribute, element.name};
        if (element.name == "ROUTE" && (attribute == "fromNode" || attribute == "toNode"))
            return {WordKind::use, Expects::use};
        if (element.name == "ROUTE" && attribute == "fromField")
            return {WordKind::routeField, Expects::routeField, ends.fromNode};
        if (element.name == "ROUTE" && attribute == "toField")
            return {WordKind::routeField, Expects::routeField, ends.toNode};
        if ((element.name == "IMPORT" && attribute == "inlineDEF") ||
            (element.name == "EXPORT" && attribute == "localDEF"))
            return {WordKind::use, Expects::use};
        if (element.name == "IMPORT" && attribute == "AS") return {WordKind::definition, Expects::nothing};
        return {WordKind::attribute, Expects::nothing};
    }

    const std::string_view text_;
    std::size_t at_ = 0, skipped_ = 0;
    DocumentWords result_;
    std::vector<Element> open_;
    WordProto::Field* declared_ = nullptr;  // by the element that is being read
};

}  // namespace

DocumentWords wordsOfXml(std::string_view text) {
    return XmlWords(text).take();
}

}  // namespace rtsg::editor
