// The statements of ClassicVRML and VRML97: header, profile, nodes, PROTOs, routes. Values and fields are in
// reader_classic_node.cpp.
#include "reader_classic.h"

#include <algorithm>
#include <array>

namespace rtsg::detail {

bool readClassic(TextFeed& text, DocumentHandler& handler, Diagnostics& diagnostics, const ReaderOptions& options) {
    return ClassicReader(text, handler, diagnostics, options).read();
}

bool accessFromKeyword(std::string_view keyword, Access& out) {
    struct Keyword {
        std::string_view word;
        Access access;
    };
    constexpr std::array<Keyword, 8> keywords = {{{"initializeOnly", Access::initializeOnly},
                                                  {"inputOnly", Access::inputOnly},
                                                  {"outputOnly", Access::outputOnly},
                                                  {"inputOutput", Access::inputOutput},
                                                  {"field", Access::initializeOnly},
                                                  {"eventIn", Access::inputOnly},
                                                  {"eventOut", Access::outputOnly},
                                                  {"exposedField", Access::inputOutput}}};
    const auto found = std::ranges::find(keywords, keyword, &Keyword::word);
    if (found == keywords.end()) return false;
    out = found->access;
    return true;
}

ClassicReader::ClassicReader(TextFeed& text, DocumentHandler& handler, Diagnostics& diagnostics,
                             const ReaderOptions& options)
    : feed_(text),
      p_(text.begin()),
      end_(text.end()),
      released_(text.begin()),
      handler_(&handler),
      loud_(&handler),
      diagnostics_(diagnostics),
      position_(text.begin()),
      meter_(text.total(), options.progress),
      types_(options.dialect),
      splitting_(options.splitting),
      headerless_(options.headerless) {}

/// Gives back text that lies far enough behind. Lines and columns are counted up to there first, since counting goes on
/// from there.
void ClassicReader::progress(const char* p) {
    meter_.at(feed_.done(p));
    constexpr std::ptrdiff_t kept = 1 << 20;
    if (holdsText_ || p - released_ < 2 * kept) return;
    released_ = p - kept;
    position_.of(released_);
    feed_.release(released_);
}

const char* ClassicReader::more(const char* end) {
    // A parser of a piece that lies within the text has all of it.
    if (end != end_) return end;
    feed_.more();
    return end_ = feed_.end();
}

bool ClassicReader::read() {
    if (!readHeader()) return false;
    readProfile();
    handler_->beginDocument(header_);
    began_ = true;
    reportHeld();
    for (;;) {
        skipSpace();
        if (p_ == end_) break;
        progress(p_);
        if (frames_.empty()) {
            statement();
            continue;
        }
        switch (frames_.back().inside) {
            case Inside::body:
                statement();
                break;
            case Inside::interface:
                interfaceItem();
                break;
            case Inside::node:
                nodeItem();
                break;
            case Inside::list:
                listItem();
                break;
        }
    }
    closeAll();
    handler_->endDocument();
    meter_.finish();
    return true;
}

bool ClassicReader::readHeader() {
    feed_.fill(kLongestHeader);
    end_ = feed_.end();
    const char* stop = std::find_if(p_, end_, [](char c) { return c == '\n' || c == '\r'; });
    const std::string_view line(p_, static_cast<std::size_t>(stop - p_));
    constexpr std::string_view x3d = "#X3D V", vrml = "#VRML V";
    std::string_view rest;
    if (line.starts_with(x3d)) {
        rest = line.substr(x3d.size());
    } else if (line.starts_with(vrml)) {
        rest = line.substr(vrml.size());
        vrml97_ = true;
    } else if (headerless_) {
        return true;
    } else {
        error(p_, "the header '#X3D V4.0 utf8' or '#VRML V2.0 utf8' is missing");
        return true;
    }
    const std::string_view version = rest.substr(0, std::min(rest.find(' '), rest.size()));
    if (vrml97_ && version.starts_with('1')) {
        error(p_, "VRML 1.0 is another language, which is not read");
        return false;
    }
    header_.version = version;
    types_.setVersion(version);
    header_.encoding = vrml97_ ? Encoding::vrml97 : Encoding::classicVrml;
    if (rest.find("utf8") == rest.npos) report(Severity::warning, p_, "the header does not say 'utf8'");
    p_ = stop;
    return true;
}

/// PROFILE comes first, and is part of what beginDocument says.
void ClassicReader::readProfile() {
    if (vrml97_) return;
    const bool isThere = peekWord() == "PROFILE";
    if (isThere) word();
    skipSpace();
    const char* where = p_;
    header_.where = at(where);
    if (!isThere) return;
    header_.profile = name();
    if (header_.profile.empty()) error(where, "expected the name of a profile");
}

void ClassicReader::closeAll() {
    if (frames_.empty()) return;
    const Frame& top = frames_.back();
    const SourceLocation opened = top.open;
    const std::string what = top.inside == Inside::list   ? "a list of nodes"
                             : top.inside == Inside::node ? std::string(top.shape.name())
                                                          : "a PROTO";
    error(end_, "the file ends inside " + what + " begun at line " + std::to_string(opened.line) + ", and " +
                    std::to_string(frames_.size()) + " levels deep: '" +
                    (top.inside == Inside::list || top.inside == Inside::interface ? "]" : "}") + "' is missing");
    while (!frames_.empty()) {
        if (frames_.back().inside == Inside::interface) {
            const SourceLocation where = at(end_);
            handler_->beginProtoBody(where);
            frames_.back().inside = Inside::body;
            types_.pushScope();
            ++bodies_;
        }
        pop();
    }
}

/// Leaves the innermost frame, telling the handler.
void ClassicReader::pop() {
    const SourceLocation where = at(p_);
    Frame frame = std::move(frames_.back());
    frames_.pop_back();
    switch (frame.inside) {
        case Inside::list:
            --lists_;
            break;
        case Inside::node:
            handler_->endNode(where);
            break;
        case Inside::interface:
        case Inside::body:
            types_.popScope();
            --bodies_;
            handler_->endProto(where);
            lists_ = outerLists_.back();
            outerLists_.pop_back();
            // Declared only now: a prototype is unknown inside its own body, which rules out recursion (4.4.4.4).
            if (!frame.proto->name.empty()) types_.declareProto(frame.proto, frame.proto->calledInFile);
            break;
    }
    if (frames_.size() == mutedAt_) {
        handler_ = loud_;
        mutedAt_ = kNotMuted;
    }
}

void ClassicReader::push(Frame frame) {
    if (frame.inside == Inside::list) ++lists_;
    if (frame.inside == Inside::interface) {
        outerLists_.push_back(lists_);
        lists_ = 0;
    }
    frames_.push_back(std::move(frame));
}

/// From here to the end of the frame about to be pushed the handler hears nothing.
void ClassicReader::mute() {
    if (mutedAt_ != kNotMuted) return;
    mutedAt_ = frames_.size();
    handler_ = &silent_;
}

void ClassicReader::statement() {
    if (*p_ == '}' && !frames_.empty()) {
        ++p_;
        pop();
        return;
    }
    if (isSeparator(*p_)) {
        stray();
        return;
    }
    const std::string_view next = peekWord();
    constexpr std::array<std::string_view, 9> keywords = {"PROTO",   "EXTERNPROTO", "ROUTE", "IMPORT", "EXPORT",
                                                          "PROFILE", "COMPONENT",   "META",  "UNIT"};
    if (std::ranges::find(keywords, next) != keywords.end())
        keywordStatement(word());
    else
        nodeStatement({});
}

void ClassicReader::keywordStatement(std::string_view keyword) {
    const char* where = keyword.data();
    if (keyword == "PROTO") {
        beginProto();
    } else if (keyword == "EXTERNPROTO") {
        externProto();
    } else if (keyword == "ROUTE") {
        route();
    } else if (keyword == "IMPORT") {
        importStatement();
    } else if (keyword == "EXPORT") {
        exportStatement();
    } else if (keyword == "META") {
        meta();
    } else if (keyword == "COMPONENT") {
        component();
    } else if (keyword == "UNIT") {
        unit();
    } else {
        error(where, "PROFILE must be the first statement");
        word();
    }
}

namespace {

/// "a.b" at its last dot: names with dots in them exist.
bool splitAtDot(std::string_view text, std::string_view& before, std::string_view& after) {
    const std::size_t dot = text.rfind('.');
    if (dot == text.npos || dot == 0 || dot + 1 == text.size()) return false;
    before = text.substr(0, dot);
    after = text.substr(dot + 1);
    return true;
}

}  // namespace

/// Reads `node.field`, with or without white space round the dot. If it returns false, `node` is the word that was
/// there.
bool ClassicReader::routeEnd(std::string_view& node, std::string_view& field) {
    const std::string_view first = word();
    if (splitAtDot(first, node, field)) {
        node = name(node);
        field = name(field);
        return true;
    }
    node = first;
    std::string_view next = peekWord();
    const bool dotBefore = first.ends_with('.'), dotBehind = !dotBefore && next.starts_with('.');
    if (first.empty() || next.empty() || (!dotBefore && !dotBehind)) return false;
    word();
    if (dotBehind && next == ".") next = word();
    node = name(dotBefore ? first.substr(0, first.size() - 1) : first);
    field = name(next.starts_with('.') ? next.substr(1) : next);
    return !node.empty() && !field.empty();
}

void ClassicReader::route() {
    skipSpace();
    const char* where = p_;
    std::string_view fromNode, fromField, toNode, toField;
    const bool fromGood = routeEnd(fromNode, fromField);
    if (!fromGood || peekWord() != "TO") {
        error(where, "expected 'ROUTE node.field TO node.field', found '" + std::string(fromNode) + "'");
        return;
    }
    word();
    skipSpace();
    const char* second = p_;
    if (!routeEnd(toNode, toField)) {
        error(second, "expected node.field behind TO, found '" + std::string(toNode) + "'");
        return;
    }
    const auto canonical = [&](std::string_view node, std::string_view field) {
        const NodeShape* shape = types_.defined(node);
        const FieldRef found = shape ? findField(*shape, field) : FieldRef{};
        return found ? found.name : field;
    };
    handler_->route(fromNode, canonical(fromNode, fromField), toNode, canonical(toNode, toField), at(where));
}

void ClassicReader::importStatement() {
    skipSpace();
    const char* where = p_;
    const std::string_view what = word();
    std::string_view inlineDef, exported;
    if (!splitAtDot(what, inlineDef, exported)) {
        error(where, "expected 'IMPORT inline.name AS name', found '" + std::string(what) + "'");
        return;
    }
    std::string_view local = exported;
    if (peekWord() == "AS") {
        word();
        skipSpace();
        local = word();
        if (local.empty()) return error(p_, "expected a name behind AS");
    }
    handler_->importNode(name(inlineDef), name(exported), name(local), at(where));
}

void ClassicReader::exportStatement() {
    skipSpace();
    const char* where = p_;
    const std::string_view local = word();
    if (local.empty()) return error(where, "expected the name of a node behind EXPORT");
    std::string_view exported = local;
    if (peekWord() == "AS") {
        word();
        skipSpace();
        exported = word();
        if (exported.empty()) return error(p_, "expected a name behind AS");
    }
    handler_->exportNode(name(local), name(exported), at(where));
}

void ClassicReader::component() {
    skipSpace();
    const char* where = p_;
    std::string what(word());
    // `name : level` with spaces is no grammar, but common.
    if (peekWord().starts_with(':')) what += word();
    if (what.ends_with(':') && isDigit(peekWord().empty() ? ' ' : peekWord()[0])) what += word();
    const std::size_t colon = what.rfind(':');
    const char* number = what.data() + (colon == what.npos ? what.size() : colon + 1);
    const char* stop = what.data() + what.size();
    std::int32_t level = 0;
    if (colon == 0 || number == stop || scanInteger(number, stop, level) != NumberStatus::ok)
        return error(where, "expected 'COMPONENT name:level', found '" + what.substr(0, 80) + "'");
    handler_->component(name(std::string_view(what).substr(0, colon)), level, at(where));
}

void ClassicReader::meta() {
    skipSpace();
    const SourceLocation where = at(p_);
    Value name, content;
    if (parseValue(FieldType::SFString, name) && parseValue(FieldType::SFString, content))
        handler_->meta(name.as<String>(), content.as<String>(), where);
}

void ClassicReader::unit() {
    skipSpace();
    const SourceLocation where = at(p_);
    const std::string_view category = word();
    skipSpace();
    const std::string_view unitName = name();
    Value factor;
    if (!parseValue(FieldType::SFDouble, factor)) return;
    if (!(factor.as<double>() > 0)) return error(category.data(), "a unit's conversion factor must be positive");
    handler_->unit(name(category), unitName, factor.as<double>(), where);
    units_.set(category, factor.as<double>());
}

void ClassicReader::beginProto() {
    skipSpace();
    const char* where = p_;
    const std::string_view name = this->name();
    if (name.empty() || !peekIs('[')) return error(p_, "expected 'PROTO name [ interface ] { body }'");
    ++p_;
    auto proto = std::make_shared<ProtoType>();
    proto->name = types_.protoName(name);
    proto->calledInFile = name;
    if (proto->name.empty()) {
        error(where, "PROTO " + std::string(name) + " has the name of a built-in node, which stays; it is left out");
        mute();
    } else if (types_.declaredHere(name)) {
        error(where, "there is a PROTO " + std::string(name) + " already, which stays; this one is left out");
        mute();
    } else if (proto->name != name) {
        report(Severity::warning, where, renamedProto(*proto));
    }
    handler_->beginProto(proto->name.empty() ? name : std::string_view(proto->name), at(where));
    push({.inside = Inside::interface, .shape = {}, .proto = proto, .field = {}, .into = {}, .open = at(where)});
}

void ClassicReader::interfaceItem() {
    if (*p_ == ']') {
        ++p_;
        endInterface();
        return;
    }
    if (*p_ == '{' || *p_ == '}') {
        error(p_, "']' is missing at the end of the PROTO's interface");
        endInterface();
        return;
    }
    if (isSeparator(*p_)) return stray();
    declare(frames_.back().proto->fields, nullptr);
}

void ClassicReader::endInterface() {
    if (peekIs('{')) {
        ++p_;
    } else {
        error(p_, "the PROTO has no body: expected '{'");
    }
    handler_->beginProtoBody(at(p_));
    frames_.back().inside = Inside::body;
    types_.pushScope();
    ++bodies_;
    if (p_[-1] != '{') pop();
}

void ClassicReader::externProto() {
    skipSpace();
    const char* where = p_;
    auto proto = std::make_shared<ProtoType>();
    proto->name = name();
    if (proto->name.empty() || !peekIs('[')) return error(p_, "expected 'EXTERNPROTO name [ interface ] url'");
    ++p_;
    while (!peekIs(']') && p_ != end_ && *p_ != '{' && *p_ != '}') {
        if (isSeparator(*p_)) {
            stray();
            continue;
        }
        FieldDeclaration field;
        const char* fieldAt = p_;
        bool recognised = false;
        if (declaration(field, fieldAt, recognised) && !proto->fields.add(field))
            error(fieldAt, "there is a field '" + field.name + "' already");
    }
    if (peekIs(']'))
        ++p_;
    else
        error(p_, "']' is missing at the end of the EXTERNPROTO's interface");
    Value url;
    if (!parseValue(FieldType::MFString, url)) url = Value(Array<String>());
    switch (types_.declareExtern(proto)) {
        case ReaderTypes::Extern::isBuiltin:
            return report(Severity::warning, where, externIsBuiltin(proto->name));
        case ReaderTypes::Extern::isOurs:
            return;
        case ReaderTypes::Extern::isThere:
            return error(where, alreadyDeclared(proto->name));
        case ReaderTypes::Extern::renamed:
            report(Severity::warning, where, renamedProto(*proto));
            break;
        case ReaderTypes::Extern::declared:
            break;
    }
    std::vector<std::string> urls;
    for (const String& one : url.as<Array<String>>()) urls.push_back(one.str());
    handler_->externProto(proto->name, {proto->fields.all().begin(), proto->fields.all().end()}, urls, at(where));
}

}  // namespace rtsg::detail
