// Turns a stream of commands that may break the rules into one that keeps them.
#include "checked_stream.h"

#include <algorithm>
#include <cmath>

#include "reader_types.h"
#include "text/utf8.h"
#include "value_numbers.h"

namespace rtsg::detail {

namespace {

constexpr DiagnosticCode kCode{"parse"};
constexpr std::string_view kEndsNames = " \t\r\n\"#',[]\\{}\x7f";

bool isName(std::string_view text) {
    return !text.empty() && text.find_first_of(kEndsNames) == text.npos && findInvalidUtf8(text) == text.npos;
}

/// Authors may give nodes any names; the writer of a document spells them as the encoding can.
bool isDef(std::string_view text) {
    const auto isControl = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; };
    return !text.empty() && std::ranges::none_of(text, isControl) && findInvalidUtf8(text) == text.npos;
}

}  // namespace

CheckedStream::CheckedStream(DocumentHandler& next, std::string format, const Dialect* dialect,
                             Diagnostics& diagnostics)
    : Filter(next), format_(std::move(format)), dialect_(dialect), diagnostics_(diagnostics) {}

void CheckedStream::fault(SourceLocation where, const std::string& what) {
    diagnostics_.error(where, "the reader of " + format_ + " files " + what, kCode);
}

bool CheckedStream::mayCome(SourceLocation where) {
    if (ended_) {
        fault(where, "goes on behind the end of its document; that is left out");
        return false;
    }
    if (!begun_) beginDocument({});
    return refused_ == 0;
}

bool CheckedStream::areNames(std::initializer_list<std::string_view> names, SourceLocation where) {
    return areAll(isName, names, where);
}

bool CheckedStream::areDefs(std::initializer_list<std::string_view> names, SourceLocation where) {
    return areAll(isDef, names, where);
}

bool CheckedStream::areAll(bool (*is)(std::string_view), std::initializer_list<std::string_view> names,
                           SourceLocation where) {
    for (const std::string_view name : names) {
        if (is(name)) continue;
        std::size_t count = 0;
        fault(where, "gives '" + replaceInvalidUtf8(name.substr(0, 80), count) + "' as a name, which it is not");
        return false;
    }
    return true;
}

// ---- the document --------------------------------------------------------------------------------------------------

void CheckedStream::beginDocument(const DocumentHeader& header) {
    if (begun_) return fault({}, "begins its document twice");
    begun_ = true;
    Filter::beginDocument(header);
}

void CheckedStream::end(SourceLocation where) {
    while (!levels_.empty()) {
        const Kind kind = levels_.back().kind;
        if (kind == Kind::node)
            Filter::endNode(where);
        else {
            if (kind == Kind::interface) Filter::beginProtoBody(where);
            Filter::endProto(where);
        }
        levels_.pop_back();
    }
    ended_ = true;
    Filter::endDocument();
}

void CheckedStream::endDocument() {
    if (!mayCome({}) && ended_) return;
    if (!levels_.empty() || refused_ > 0) fault({}, "ends its document within a node or a prototype");
    end({});
}

void CheckedStream::close(bool complete) {
    if (begun_ && !ended_) {
        if (complete) fault({}, "does not end its document");
        end({});
    }
    if (notFinite_)
        diagnostics_.error(
            {}, std::to_string(notFinite_) + " numbers of the " + format_ + " file are not finite; 0 is taken instead",
            kCode);
    if (notUtf8_)
        diagnostics_.error(
            {}, std::to_string(notUtf8_) + " bytes of the " + format_ + " file's texts are not valid UTF-8 (or zero)",
            kCode);
}

void CheckedStream::component(std::string_view name, int level, SourceLocation where) {
    if (mayCome(where) && areNames({name}, where)) Filter::component(name, level, where);
}

void CheckedStream::meta(std::string_view name, std::string_view content, SourceLocation where) {
    if (mayCome(where)) Filter::meta(mended(name), mended(content), where);
}

void CheckedStream::unit(std::string_view category, std::string_view name, double conversionFactor,
                         SourceLocation where) {
    if (!mayCome(where) || !areNames({category, name}, where)) return;
    if (!(std::isfinite(conversionFactor) && conversionFactor > 0))
        return fault(where, "gives a unit a factor that is not above 0");
    Filter::unit(category, name, conversionFactor, where);
}

// ---- nodes ---------------------------------------------------------------------------------------------------------

bool CheckedStream::mayHoldNode(std::string_view field, SourceLocation where) {
    if (isAmongNodes()) {
        if (!field.empty()) fault(where, "puts a node into field '" + mended(field) + "' of no node");
        return true;
    }
    if (field.empty()) return fault(where, "puts a node into no field of the node around it"), false;
    const NodeType* type = levels_.back().type;
    if (!type) return true;
    const FieldIndex index = type->find(field);
    if (index != kNoField && sf(type->fields[index].type) == FieldType::SFNode) return true;
    if (declaresFields(*type)) return true;
    fault(where, "puts a node into '" + mended(field) + "', which is no field of " + type->name + " for nodes");
    return false;
}

void CheckedStream::beginNode(std::string_view type, std::string_view def, std::string_view field,
                              SourceLocation where) {
    const bool good = mayCome(where) && areNames({type}, where) && (def.empty() || areDefs({def}, where)) &&
                      mayHoldNode(field, where);
    if (ended_) return;
    if (!good) {
        ++refused_;
        return;
    }
    const NodeType* known = findBuiltinType(type);
    if (!known && dialect_) known = dialect_->findType(type).get();  // the dialect keeps it
    Filter::beginNode(type, def, isAmongNodes() ? std::string_view() : field, where);
    levels_.push_back({Kind::node, known});
}

void CheckedStream::endNode(SourceLocation where) {
    if (refused_ > 0) {
        --refused_;
        return;
    }
    if (!mayCome(where)) return;
    if (!isIn(Kind::node)) return fault(where, "ends a node that it has not begun");
    levels_.pop_back();
    Filter::endNode(where);
}

void CheckedStream::useNode(std::string_view def, std::string_view field, SourceLocation where) {
    if (!mayCome(where) || !areDefs({def}, where) || !mayHoldNode(field, where)) return;
    Filter::useNode(def, isAmongNodes() ? std::string_view() : field, where);
}

bool CheckedStream::fits(std::string_view name, const Value& value, SourceLocation where) {
    const bool namesNodes = (value.holds<NodeId>() && value.as<NodeId>()) ||
                            (value.holds<Array<NodeId>>() && !value.as<Array<NodeId>>().empty());
    if (namesNodes) return fault(where, "gives field '" + std::string(name) + "' nodes as numbers"), false;
    const NodeType* type = levels_.back().type;
    if (!type) return true;
    const FieldIndex index = type->find(name);
    if (index == kNoField) {
        if (declaresFields(*type)) return true;
        return fault(where, "sets '" + std::string(name) + "', which is no field of " + type->name), false;
    }
    const FieldDef& expected = type->fields[index];
    if (expected.holds(value)) return true;
    fault(where, "gives field '" + std::string(name) + "' of " + type->name + " a value of type " + typeNameOf(value) +
                     "; it is of type " + expected.typeName());
    return false;
}

void CheckedStream::setField(std::string_view name, Value value, SourceLocation where) {
    if (!mayCome(where)) return;
    if (!isIn(Kind::node)) return fault(where, "sets a field of no node");
    if (!areNames({name}, where) || !fits(name, value, where)) return;
    mend(value);
    Filter::setField(name, std::move(value), where);
}

void CheckedStream::mend(Value& value) {
    std::ptrdiff_t bad = 0;
    const auto isBad = [](auto number) { return !std::isfinite(number); };
    seeNumbers(value, [&](auto numbers) { bad = std::ranges::count_if(numbers, isBad); });
    if (bad > 0) {  // else, as ever, nothing is copied
        changeNumbers(value, [&](auto numbers) { std::ranges::replace_if(numbers, isBad, 0); });
        notFinite_ += static_cast<std::size_t>(bad);
    }
    const auto isBroken = [](const String& text) { return findInvalidUtf8(text.view()) != std::string_view::npos; };
    if (value.holds<String>()) {
        if (isBroken(value.as<String>())) value = Value(String(mended(value.as<String>().view())));
    } else if (value.holds<Array<String>>() && std::ranges::any_of(value.as<Array<String>>(), isBroken)) {
        Array<String> all;
        for (const String& one : value.as<Array<String>>()) all.push_back(String(mended(one.view())));
        value = Value(std::move(all));
    }
}

std::string CheckedStream::mended(std::string_view text) {
    if (findInvalidUtf8(text) == text.npos) return std::string(text);
    std::size_t count = 0;
    std::string clean = replaceInvalidUtf8(text, count);
    notUtf8_ += count;
    return clean;
}

// ---- prototypes and statements -------------------------------------------------------------------------------------

void CheckedStream::declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) {
    if (!mayCome(where) || !areNames({field.name}, where)) return;
    if (isAmongNodes()) return fault(where, "declares a field of no node and no prototype");
    if (value && value->type() != field.type)
        return fault(where, "gives field '" + field.name + "' a value of another type than it declares");
    if (value) mend(*value);
    Filter::declareField(field, std::move(value), where);
}

void CheckedStream::isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) {
    if (!mayCome(where) || !areNames({nodeField, protoField}, where)) return;
    if (!isIn(Kind::node)) return fault(where, "connects a field of no node");
    Filter::isConnection(nodeField, protoField, where);
}

void CheckedStream::beginProto(std::string_view name, SourceLocation where) {
    bool good = mayCome(where) && areNames({name}, where);
    if (ended_) return;
    if (good && !isAmongNodes()) {
        fault(where, "declares a prototype within a node");
        good = false;
    }
    if (!good) {
        ++refused_;
        return;
    }
    levels_.push_back({Kind::interface});
    Filter::beginProto(name, where);
}

void CheckedStream::beginProtoBody(SourceLocation where) {
    if (!mayCome(where)) return;
    if (!isIn(Kind::interface)) return fault(where, "begins the body of no prototype");
    levels_.back().kind = Kind::body;
    Filter::beginProtoBody(where);
}

void CheckedStream::endProto(SourceLocation where) {
    if (refused_ > 0) {
        --refused_;
        return;
    }
    if (!mayCome(where)) return;
    if (isIn(Kind::interface)) beginProtoBody(where);
    if (!isIn(Kind::body)) return fault(where, "ends a prototype that it has not begun");
    levels_.pop_back();
    Filter::endProto(where);
}

void CheckedStream::externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                                const std::vector<std::string>& url, SourceLocation where) {
    if (!mayCome(where) || !areNames({name}, where)) return;
    if (!isAmongNodes()) return fault(where, "declares a prototype within a node");
    for (const FieldDeclaration& field : fields)
        if (!areNames({field.name}, where)) return;
    std::vector<std::string> urls;
    for (const std::string& one : url) urls.push_back(mended(one));
    Filter::externProto(name, fields, urls, where);
}

void CheckedStream::route(std::string_view fromNode, std::string_view fromField, std::string_view toNode,
                          std::string_view toField, SourceLocation where) {
    if (!mayCome(where) || !areDefs({fromNode, toNode}, where) || !areNames({fromField, toField}, where)) return;
    Filter::route(fromNode, fromField, toNode, toField, where);
}

void CheckedStream::importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                               SourceLocation where) {
    if (mayCome(where) && areDefs({inlineDef, exportedName, localName}, where))
        Filter::importNode(inlineDef, exportedName, localName, where);
}

void CheckedStream::exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) {
    if (mayCome(where) && areDefs({localName, exportedName}, where)) Filter::exportNode(localName, exportedName, where);
}

void CheckedStream::comment(std::string_view text, SourceLocation where) {
    if (mayCome(where)) Filter::comment(mended(text), where);
}

void CheckedStream::documentation(const Documentation& about, SourceLocation where) {
    if (mayCome(where)) Filter::documentation({mended(about.appinfo), mended(about.documentation)}, where);
}

}  // namespace rtsg::detail
