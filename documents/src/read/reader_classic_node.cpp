// Inside a ClassicVRML node: words, field values, declarations, and how to go on after an error.
#include <algorithm>
#include <utility>

#include "commands/suggestion.h"
#include "reader_classic.h"

namespace rtsg::detail {

void ClassicReader::report(Severity severity, const char* where, std::string text) {
    // Finding the position costs time, and past the limit nobody reads it.
    diagnostics_.add(severity, diagnostics_.dropped() ? SourceLocation{} : at(where), std::move(text));
}

void ClassicReader::skipSpace() {
    FieldTextParser parser(p_, end_, TextSyntax::classicVrml, *this);
    parser.skipSpace();
    p_ = parser.p;
    if (comment_) reportComment();
}

/// Lines that follow each other without an empty one between them are one comment.
void ClassicReader::comment(std::string_view line) {
    if (line.data() < reported_) return;  // reading went back a little
    reported_ = line.data() + line.size();
    if (comment_ && std::count(commentEnd_, line.data(), '\n') > 1) reportComment();
    if (!comment_) commentStart_ = line.data();
    commentEnd_ = line.data() + line.size();
    line.remove_prefix(line.starts_with("# ") ? 2 : 1);
    if (comment_)
        comment_->append(1, '\n').append(line);  // in place: there may be millions of lines
    else
        comment_.emplace(line);
}

void ClassicReader::reportComment() {
    const std::string text = tidyComment(*comment_);
    comment_.reset();
    if (text.empty()) return;
    if (!began_ || holdsText_)
        early_.emplace_back(text, at(commentStart_));
    else
        handler_->comment(text, at(commentStart_));
}

std::string_view ClassicReader::word() {
    const std::string_view next = peekWord();
    p_ = next.data() + next.size();
    return next;
}

std::string_view ClassicReader::peekWord() {
    skipSpace();
    const char* stop = endOfWord(p_, end_);
    while (stop == end_ && more(stop) != stop) stop = endOfWord(stop, end_);
    return {p_, static_cast<std::size_t>(stop - p_)};
}

bool ClassicReader::parseValue(FieldType type, Value& out, const CustomType* custom) {
    FieldTextParser parser(p_, end_, TextSyntax::classicVrml, *this);
    const bool usable = parser.parse(type, out, custom);
    p_ = parser.p;
    if (comment_) reportComment();
    return usable;
}

/// Skips one token that has no place here, saying so.
void ClassicReader::stray() {
    if (*p_ == '"') {
        error(p_, "a string has no place here");
        String text;
        FieldTextParser parser(p_, end_, TextSyntax::classicVrml, *this);
        parser.parseQuoted(text);
        p_ = parser.p;
    } else if (isSeparator(*p_)) {
        error(p_, *p_ == '\0' ? "a zero byte has no place here" : std::string("unexpected '") + *p_ + "'");
        ++p_;
    } else {
        const char* where = p_;
        error(where, "unexpected '" + std::string(word().substr(0, 40)) + "'");
    }
}

/// `p_` is on `{` or `[`; moves behind the matching bracket.
void ClassicReader::skipBalanced() {
    std::size_t depth = 0;
    do {
        const char c = *p_;
        if (c == '"') {
            String text;
            FieldTextParser parser(p_, end_, TextSyntax::classicVrml, *this);
            parser.parseQuoted(text);
            p_ = parser.p;
        } else {
            depth += c == '{' || c == '[';
            depth -= c == '}' || c == ']';
            ++p_;
        }
        if (depth) skipSpace();
        progress(p_);
    } while (depth && p_ != end_);
}

/// Is this word rather the next field or declaration than part of a value?
bool ClassicReader::startsItem(std::string_view next) const {
    if (frames_.empty() || frames_.back().inside == Inside::list) return false;
    Access access{};
    if (frames_.back().inside == Inside::node && findField(frames_.back().shape, next)) return true;
    return accessFromKeyword(next, access);
}

/// Skips a value of unknown type, or the rest of a faulty one: numbers, strings, a list, or one node. `valueEnd_` is
/// then behind it, and before the comments that follow.
void ClassicReader::skipValue() {
    bool any = false;
    for (;;) {
        valueEnd_ = p_;
        skipSpace();
        if (p_ == end_ || *p_ == '}' || *p_ == ']') return;
        if (*p_ == '[' || *p_ == '{') {
            skipBalanced();
            break;
        }
        if (*p_ == '"') {
            String text;
            FieldTextParser parser(p_, end_, TextSyntax::classicVrml, *this);
            parser.parseQuoted(text);
            p_ = parser.p;
            any = true;
            continue;
        }
        if (isSeparator(*p_)) return;  // a zero byte: someone else's complaint
        const std::string_view next = peekWord();
        const char c = next[0];
        const bool number = isDigit(c) || c == '-' || c == '+' || c == '.';
        if (number || next == "TRUE" || next == "FALSE") {
            word();
            any = true;
            continue;
        }
        if (any || (startsItem(next) && !startsNode())) return;
        if (next == "NULL" || next == "USE" || next == "IS") {
            word();
            if (next != "NULL") word();
            break;
        }
        if (next == "DEF") {
            word();
            word();
        }
        word();
        valueEnd_ = p_;
        if (!peekIs('{')) return;
        skipBalanced();
        break;
    }
    valueEnd_ = p_;
}

void ClassicReader::nodeStatement(const FieldRef& into) {
    const char* where = p_;
    std::string_view next = word();
    if (next == "USE") return useNode(into, where);
    std::string_view def;
    if (next == "DEF") {
        const std::string_view spelled = word();
        def = name(spelled);
        if (const std::string fault = faultOfDef(spelled, Spelling::classic); !fault.empty())
            report(Severity::warning, spelled.data(), badDef(spelled, fault));
        next = word();
        // `DEF my box Box { }`
        if (!next.empty() && !types_.find(next).known() && !peekIs('{') && types_.find(peekWord()).known()) {
            error(next.data(), "a name has no white space: 'DEF " + std::string(def) + " " + std::string(next) +
                                   "' could be 'DEF " + std::string(def) + "_" + std::string(next) + "'");
            next = word();
        }
    }
    if (next.empty()) return error(p_, "expected a node");
    beginNode(name(next), def, into, where);
}

void ClassicReader::useNode(const FieldRef& into, const char* where) {
    const std::string_view name = this->name();
    if (name.empty()) return error(p_, "expected the name of a node behind USE");
    if (const NodeShape* shape = types_.defined(name)) {
        checkPosition(into, *shape, where);
        beganNode(*shape);
    }
    handler_->useNode(name, into.name, at(where));
}

/// The wrong type of node in a field is kept, so that nothing an author wrote is lost; its parent will not use it.
void ClassicReader::checkPosition(const FieldRef& into, const NodeShape& shape, const char* where) {
    if (!into || accepts(into, shape.standsFor()) || frames_.empty()) return;
    const Frame& inner = frames_.back();
    const Frame& parent = inner.inside == Inside::list && frames_.size() > 1 ? frames_[frames_.size() - 2] : inner;
    report(Severity::warning, where, misplaced(shape.name(), into.name, parent.shape.name()));
}

/// The first node of a PROTO's body decides where its instances may stand.
void ClassicReader::beganNode(const NodeShape& shape) {
    if (frames_.empty() || frames_.back().inside != Inside::body) return;
    ProtoType& proto = *frames_.back().proto;
    if (proto.hasBody) return;
    proto.hasBody = true;
    proto.primary = shape.standsFor();
}

void ClassicReader::beginNode(std::string_view type, std::string_view def, const FieldRef& into, const char* where) {
    NodeShape shape = types_.find(type);
    if (!peekIs('{')) {
        error(where, shape.known() ? "expected '{' behind " + std::string(type)
                                   : "unexpected '" + std::string(type.substr(0, 40)) + "'");
        return;
    }
    if (!shape.known()) report(Severity::warning, where, unknownType(type, diagnostics_));
    ++p_;
    beganNode(shape);
    checkPosition(into, shape, where);
    if (shape.type && declaresFields(*shape.type)) shape.own = std::make_shared<DeclaredFields>();
    if (!def.empty()) types_.define(def, shape);
    handler_->beginNode(shape.name(), def, into.name, at(where));
    push({.inside = Inside::node, .shape = std::move(shape), .proto = {}, .field = {}, .into = {}, .open = at(where)});
}

void ClassicReader::nodeItem() {
    if (*p_ == '}') {
        ++p_;
        pop();
        return;
    }
    if (*p_ == ']') return closeBracket();
    if (isSeparator(*p_)) return stray();
    const char* where = p_;
    const std::string_view name = word();
    const NodeShape& shape = frames_.back().shape;
    Access access{};
    if (shape.own && accessFromKeyword(name, access)) {
        p_ = where;
        return declare(*shape.own, &shape);
    }
    if (name == "ROUTE" || name == "PROTO" || name == "EXTERNPROTO" || name == "IMPORT" || name == "EXPORT")
        return keywordStatement(name);
    if (shape.known() && !findField(shape, name))
        if (const NodeShape node = nodeBehind(name); node.known()) return nodeWithoutField(node, where);
    fieldItem(this->name(name), where);
}

/// The node that begins with this word, if one does: `Type {`, `DEF name Type {` or `USE name`; `p_` stays behind the
/// word.
NodeShape ClassicReader::nodeBehind(std::string_view next) {
    const char* const start = p_;
    NodeShape result;
    if (next == "USE") {
        if (const NodeShape* shape = types_.defined(name())) result = *shape;
    } else {
        const bool named = next == "DEF";
        if (named) word();
        const std::string_view type = named ? word() : next;
        if (!type.empty() && peekIs('{')) result = types_.find(type);
    }
    p_ = start;
    return result;
}

/// A node where a field should be. Where it has a place in the open node, the field's name is missing, or the brace
/// that ends the open node; it is read as if the name were there. Where it has none, the brace is missing, of the open
/// nodes up to where a node may stand.
void ClassicReader::nodeWithoutField(const NodeShape& node, const char* where) {
    const NodeShape& open = frames_.back().shape;
    const NodeType* type = node.standsFor();
    const std::string begun = std::string(open.name()) + " begun at line " + std::to_string(frames_.back().open.line);
    const FieldRef field = type ? findField(open, type->containerField) : FieldRef{};
    p_ = where;
    if (field && field.takesValue() && accepts(field, type) && frames_.back().given.add(field)) {
        error(where, "'" + std::string(field.name) + "' is missing before " + std::string(node.name()) + " in " +
                         begun + ", or '}' at the end of that");
        return nodeStatement(field);
    }
    error(where, "'}' is missing before " + std::string(node.name()) + ", at the end of " + begun);
    while (!frames_.empty() && frames_.back().inside == Inside::node) pop();
}

/// `]` where a field should be: the braces of this node, and of others up to the list, are missing.
void ClassicReader::closeBracket() {
    if (lists_ == 0) return stray();
    error(p_, "'}' is missing before ']', for " + std::string(frames_.back().shape.name()) + " begun at line " +
                  std::to_string(frames_.back().open.line));
    while (frames_.back().inside == Inside::node) pop();
}

void ClassicReader::listItem() {
    if (*p_ == ']') {
        ++p_;
        pop();
        return;
    }
    if (*p_ == '}') {
        error(p_, "']' is missing before '}', at the end of " + std::string(frames_.back().field));
        pop();
        return;
    }
    if (isSeparator(*p_)) return stray();
    if (peekWord() == "NULL") {
        report(Severity::warning, p_, "NULL in a list of nodes is left out");
        word();
        return;
    }
    const FieldRef into = frames_.back().into;
    nodeStatement(into);
}

void ClassicReader::fieldItem(std::string_view name, const char* where) {
    const NodeShape& shape = frames_.back().shape;  // until something is pushed
    const FieldRef field = types_.findField(shape, name);
    if (!field) return unknownField(name, where);
    if (field.name != name)
        if (const std::string outdated = types_.outdatedName(shape, name); !outdated.empty())
            report(Severity::warning, where, outdated);
    if (peekWord() == "IS") {
        word();
        const std::string_view protoField = this->name();
        if (protoField.empty()) return error(p_, "expected the name of an interface field behind IS");
        if (bodies_ == 0) return error(where, "IS has a meaning in the body of a PROTO only");
        handler_->isConnection(field.name, protoField, at(where));
        return;
    }
    if (!frames_.back().given.add(field))
        return unknownField(
            field.name, where,
            sf(field.type) == FieldType::SFNode
                ? std::string()
                : std::string(field.name) + " of " + std::string(shape.name()) + " is given already; this is left out");
    if (!field.takesValue()) {
        error(where, std::string(field.name) + " of " + std::string(shape.name()) + " is an event, it takes no value");
        return skipValue();
    }
    if (sf(field.type) == FieldType::SFNode) return nodeValue(field, where);
    if (nodesFollow()) return unknownField(field.name, where);
    Value value;
    // The text may be gone once a long value has been read.
    const SourceLocation here = at(where), start = at(p_);
    if (!parseValue(field.type, value, field.custom)) return skipValue();
    units_.toStandard(field.definition, value);
    if (field.definition) {
        if (std::string complaint = valueComplaint(*field.definition, value); !complaint.empty())
            diagnostics_.warning(start, std::move(complaint));
    }
    handler_->setField(field.name, std::move(value), here);
}

/// Says which node around the open one has the field: a brace may be missing.
std::string ClassicReader::ofUnclosed(std::string_view field) const {
    constexpr std::size_t kNear = 64;
    for (std::size_t i = frames_.size() - 1, last = i - std::min(i, kNear); i-- > last;) {
        const Frame& around = frames_[i];
        if (around.inside != Inside::node && around.inside != Inside::list) break;
        if (around.inside == Inside::node && around.shape.known() && findField(around.shape, field))
            return "; " + std::string(around.shape.name()) + " begun at line " + std::to_string(around.open.line) +
                   " has one: is a '}' missing?";
    }
    return {};
}

/// Reads the value of a field that the open node does not have, or that was given before. Nodes there are kept with
/// their names, although they are in no field; other values are kept as text in nodes of unknown types. `ifNoNodes` is
/// the error if there are no nodes.
void ClassicReader::unknownField(std::string_view name, const char* where, const std::string& ifNoNodes) {
    skipSpace();
    const bool isList = p_ != end_ && *p_ == '[';
    const char* start = p_;
    if (isList) ++p_;
    const std::string_view next = peekWord();
    const auto isNodeWord = [](std::string_view word) {
        if (word.empty() || isDigit(word[0]) || word[0] == '-' || word[0] == '+' || word[0] == '.') return false;
        return word != "TRUE" && word != "FALSE" && word != "NULL" && word != "IS";
    };
    const FieldRef into{kept(name), isList ? FieldType::MFNode : FieldType::SFNode};
    const NodeShape shape = frames_.back().shape;
    const bool complain = shape.known();
    if (isNodeWord(next) && (isList || startsNode())) {
        if (complain) {
            const FieldRef field = findField(shape, name);
            const bool takesNodes = field && sf(field.type) == FieldType::SFNode;
            p_ += next.size();
            const bool isKnown = nodeBehind(next).known();
            p_ -= next.size();
            if (!field)
                report(isMisspelled(name, isKnown) ? Severity::error : Severity::warning, where,
                       noFieldForNodes(shape, name, diagnostics_) + (isKnown ? ofUnclosed(name) : std::string()));
            else
                report(Severity::warning, where,
                       takesNodes ? surplus(name, shape.name()) : misplaced(next, name, shape.name()));
        }
        return isList ? openList(into) : nodeStatement(into);
    }
    p_ = start;
    if (!ifNoNodes.empty()) error(where, ifNoNodes);
    if (complain && !findField(shape, name)) {
        const std::string dropped = droppedField(shape, name);
        dropped.empty() ? error(where, noField(shape, name, diagnostics_) + ofUnclosed(name))
                        : report(Severity::warning, where, dropped);
    }
    if (next == "IS" && !isList && !shape.known()) {
        word();
        const std::string_view protoField = this->name();
        if (!protoField.empty() && bodies_ > 0) handler_->isConnection(name, protoField, at(where));
        return;
    }
    holdsText_ = !shape.known();
    skipValue();
    holdsText_ = false;
    if (!shape.known() && p_ != start) keepText(name, where, start, isList);
    reportHeld();  // what was said behind the value
}

void ClassicReader::reportHeld() {
    for (const auto& [text, entry] : std::exchange(early_, {})) handler_->comment(text, entry);
}

/// The value from `start` to `valueEnd_` as a field of the open node, which is of an unknown type.
void ClassicReader::keepText(std::string_view name, const char* where, const char* start, bool isList) {
    if (!frames_.back().unknownGiven.insert(kept(name)).second)
        return error(start, std::string(name.substr(0, 80)) + " is given already; this is left out");
    std::string_view text(start, static_cast<std::size_t>(std::max(valueEnd_, start) - start));
    const auto isFiller = [](char c) { return isSpace(c) || c == ','; };
    while (!text.empty() && isFiller(text.back())) text.remove_suffix(1);
    if (isList) text = text.substr(1, text.size() - (text.ends_with(']') ? 2 : 1));
    while (isList && !text.empty() && isFiller(text.back())) text.remove_suffix(1);
    while (isList && !text.empty() && isFiller(text.front())) text.remove_prefix(1);
    if (text.starts_with('"') && !isList) {
        FieldTextParser parser(text.data(), text.data() + text.size(), TextSyntax::classicVrml, *this);
        String one;
        parser.parseQuoted(one);
        if (parser.p == text.data() + text.size()) return handler_->setField(name, Value(std::move(one)), at(where));
    }
    if (text != "NULL") handler_->setField(name, Value(String(text)), at(where));
}

/// Whether nodes or a list of them follow: `DEF name`, `USE name` or `Type {`.
bool ClassicReader::nodesFollow() {
    skipSpace();
    const char* const start = p_;
    if (p_ != end_ && *p_ == '[') {
        ++p_;
        skipSpace();
    }
    const bool letter = p_ != end_ && ((*p_ >= 'A' && *p_ <= 'Z') || (*p_ >= 'a' && *p_ <= 'z') || *p_ == '_');
    const bool nodes = letter && startsNode();
    p_ = start;
    return nodes;
}

bool ClassicReader::startsNode() {
    const char* start = p_;
    const std::string_view next = word();
    const bool starts = next == "DEF" || next == "USE" || peekIs('{');
    p_ = start;
    return starts;
}

/// Behind the name of an SFNode or MFNode field of the open node.
void ClassicReader::nodeValue(const FieldRef& field, const char* where) {
    if (peekIs('[')) {
        if (!isMF(field.type)) {
            error(p_, std::string(field.name) + " takes one node, not a list");
            return skipBalanced();
        }
        ++p_;
        if (peekIs(']')) {
            ++p_;
            handler_->setField(field.name, Value(Array<NodeId>()), at(where));
            return;
        }
        return openList(field);
    }
    const std::string_view next = peekWord();
    if (next == "NULL") {
        word();
        handler_->setField(field.name, Value::zero(field.type), at(where));
        return;
    }
    if (next.empty() || isDigit(next[0]) || next[0] == '-' || next[0] == '+' || next[0] == '.') {
        error(p_, std::string(field.name) + " takes a node");
        return skipValue();
    }
    nodeStatement(field);
}

void ClassicReader::openList(const FieldRef& field) {
    push({.inside = Inside::list, .shape = {}, .proto = {}, .field = field.name, .into = field, .open = at(p_)});
}

/// Reads `access type name`. Returns false if something else was there, which has then been skipped and reported.
bool ClassicReader::declaration(FieldDeclaration& out, const char*& where, bool& recognised) {
    skipSpace();
    where = p_;
    const std::string_view keyword = word();
    recognised = accessFromKeyword(keyword, out.access);
    if (!recognised) {
        error(where, "expected a field's declaration, found '" + std::string(keyword.substr(0, 40)) + "'");
        return false;
    }
    skipSpace();
    const char* typeAt = p_;
    const std::string_view type = word();
    const bool typeKnown = fieldTypeFromName(type, out.type, out.custom);
    out.name = name();
    if (!typeKnown) error(typeAt, "'" + std::string(type.substr(0, 40)) + "' is no field type");
    if (out.name.empty()) error(p_, "expected the name of a field");
    return typeKnown && !out.name.empty();
}

/// One declaration with its value, in a PROTO's interface (`node` is null) or in a Script or shader.
void ClassicReader::declare(DeclaredFields& fields, const NodeShape* node) {
    FieldDeclaration field;
    const char* where = p_;
    bool recognised = false;
    if (!declaration(field, where, recognised)) {
        if (recognised) skipValue();
        return;
    }
    if (node && node->type->findExact(field.name) != kNoField) {
        // X3D 4.0 gave Script a description; scripts of before may declare one, meaning the same.
        const FieldRef builtin = findField(*node, field.name);
        report(Severity::warning, where, "Script has a field '" + field.name + "' of its own");
        if (field.access == Access::inputOnly || field.access == Access::outputOnly) return;
        if (!haveOneType(builtin, field)) return skipValue();
        return fieldItem(builtin.name, where);
    }
    if (!fields.add(field)) {
        error(where, "there is a field '" + field.name + "' already");
        if (field.access == Access::initializeOnly || field.access == Access::inputOutput) skipValue();
        return;
    }
    const FieldRef ref = findField(fields, field.name);
    const bool takesValue = ref.takesValue();
    if (node) frames_.back().given.add(ref);
    // A comment behind a field that takes no value belongs to the next field.
    holdsText_ = true;
    const bool isConnected = node && peekWord() == "IS";
    holdsText_ = false;
    if (!takesValue && !isConnected) {
        handler_->declareField(field, std::nullopt, at(where));
        return reportHeld();
    }
    reportHeld();
    if (isConnected) {
        handler_->declareField(field, std::nullopt, at(where));
        word();
        const std::string_view protoField = this->name();
        if (protoField.empty() || bodies_ == 0)
            return error(p_, "IS needs an interface field's name, in the body of a PROTO");
        handler_->isConnection(ref.name, protoField, at(where));
        return;
    }
    if (sf(field.type) != FieldType::SFNode) {
        Value value;
        const SourceLocation here = at(where);
        if (!parseValue(field.type, value, field.custom.get())) {
            skipValue();
            value = zeroOf(field.type, field.custom.get());
        }
        units_.toStandard(nullptr, value);
        handler_->declareField(field, std::move(value), here);
        return;
    }
    if (peekIs('[') && isMF(field.type)) {
        ++p_;
        if (peekIs(']')) {
            ++p_;
            handler_->declareField(field, Value(Array<NodeId>()), at(where));
            return;
        }
        handler_->declareField(field, std::nullopt, at(where));
        return openList(ref);
    }
    const std::string_view next = peekWord();
    Access access{};
    if (next == "NULL" || next.empty() || (accessFromKeyword(next, access) && !startsNode())) {
        if (next == "NULL")
            word();
        else
            error(p_, "expected a node or NULL");
        handler_->declareField(field, Value::zero(field.type), at(where));
        return;
    }
    handler_->declareField(field, std::nullopt, at(where));
    nodeStatement(ref);
}

}  // namespace rtsg::detail
