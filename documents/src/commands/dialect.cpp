// Keeps formats and node types that an application or a plug-in has added, and finds them again.
#include <rtsg/documents/dialect.h>

#include <algorithm>
#include <ranges>

#include <rtsg/core/check.h>

namespace rtsg {

namespace {

/// Two tables may describe one type: that of a plug-in, and the one that the user names beside it.
bool isSameType(const NodeType& a, const NodeType& b) {
    const auto same = [](const FieldDef& x, const FieldDef& y) {
        return x.name == y.name && haveOneType(x, y) && x.access == y.access && x.aspect == y.aspect &&
               x.hidden == y.hidden && x.defaultValue == y.defaultValue && x.min == y.min && x.max == y.max &&
               x.unit == y.unit && x.accepts == y.accepts && x.allowed == y.allowed;
    };
    return a.component == b.component && a.containerField == b.containerField && a.implements == b.implements &&
           a.acts == b.acts && a.role == b.role && std::ranges::equal(a.fields, b.fields, same);
}

}  // namespace

void Dialect::add(FormatReader reader) {
    RTSG_CHECK_EQ(reader.recognises && reader.read, true);
    readers_.push_back(std::move(reader));
}

void Dialect::add(FormatWriter writer) {
    RTSG_CHECK_EQ(static_cast<bool>(writer.make), true);
    writers_.push_back(std::move(writer));
}

Result<> Dialect::add(std::shared_ptr<const NodeType> type) {
    if (findBuiltinType(type->name)) return fail("there is a node type " + type->name + " already, a built-in one");
    if (const auto known = findType(type->name)) {
        if (isSameType(*known, *type)) return {};
        return fail("there is a node type " + type->name + " already, which is another one");
    }
    types_.push_back(std::move(type));
    return {};
}

const FormatReader* Dialect::readerOf(const FormatClue& clue) const {
    for (const FormatReader& reader : readers_ | std::views::reverse) {
        try {
            if (reader.recognises(clue)) return &reader;
        } catch (...) {  // foreign code: a format that fails to describe itself does not fit
            continue;
        }
    }
    return nullptr;
}

const FormatWriter* Dialect::writerOf(std::string_view extension) const {
    for (const FormatWriter& writer : writers_ | std::views::reverse)
        if (std::ranges::find(writer.extensions, extension) != writer.extensions.end()) return &writer;
    return nullptr;
}

std::shared_ptr<const NodeType> Dialect::findType(std::string_view name) const {
    const auto found = std::ranges::find(types_, name, [](const auto& type) { return std::string_view(type->name); });
    return found == types_.end() ? nullptr : *found;
}

}  // namespace rtsg
