// Gives equal points, normals, colours and texture coordinates one place, and triangles without indices some.
#include <algorithm>
#include <cstring>
#include <numeric>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "commands/document_tree.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

/// The bytes of one list, element by element, and where the list is.
struct List {
    DocumentTree::Index item;  // of the value
    std::string_view bytes;
    std::size_t count, each;
    std::string_view at(std::size_t i) const { return bytes.substr(i * each, each); }
};

template <class T>
std::optional<List> listOf(DocumentTree::Index item, const Value& value) {
    if (!value.holds<Array<T>>()) return {};
    const auto all = value.as<Array<T>>().span();
    return List{item, {reinterpret_cast<const char*>(all.data()), all.size_bytes()}, all.size(), sizeof(T)};
}

template <class T>
void keepOnly(Value& value, const std::vector<std::size_t>& kept) {
    if (!value.holds<Array<T>>()) return;
    const Array<T> all = value.as<Array<T>>();
    Array<T> result;
    result.resize(kept.size());
    for (std::size_t i = 0; i < kept.size(); ++i) result.mutableData()[i] = all[kept[i]];
    value = Value(std::move(result));
}

/// Which elements stay, and which of those each one is.
struct Distinct {
    std::vector<std::size_t> kept;
    std::vector<std::int32_t> now;
};
Distinct distinct(const std::vector<List>& lists) {
    Distinct result;
    const std::size_t count = lists.front().count;
    std::unordered_map<std::string, std::int32_t> known;
    std::string key;
    result.now.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        key.clear();
        for (const List& list : lists) key += list.at(i);
        const auto [found, isNew] = known.try_emplace(key, static_cast<std::int32_t>(result.kept.size()));
        if (isNew) result.kept.push_back(i);
        result.now.push_back(found->second);
    }
    return result;
}

class IndexFilter final : public TreeFilter {
  public:
    using TreeFilter::TreeFilter;

    void change() override {
        for (const Index scope : scopes()) {
            uses_ = usesIn(scope);
            std::vector<Index> found;
            walk(
                scope,
                [&](Index index) {
                    const Item& item = (*this)[index];
                    if (item.kind == Kind::node && !isReferred(item)) found.push_back(index);
                    return item.kind != Kind::body || index == scope;
                },
                [](Index) {});
            for (const Index index : found) {
                const std::string type = (*this)[index].name;
                if (type == "IndexedFaceSet" || type == "IndexedLineSet") separately(index);
                if (type == "IndexedTriangleSet" || type == "TriangleSet" || type == "IndexedQuadSet" ||
                    type == "QuadSet")
                    together(index);
            }
        }
    }

  private:
    bool isReferred(const Item& item) const { return !item.def.empty() && uses_.contains(item.def); }

    Item* valueOf(Index node, std::string_view field) {
        for (const Index index : (*this)[node].items)
            if ((*this)[index].kind == Kind::value && (*this)[index].field == field) return &(*this)[index];
        return nullptr;
    }
    /// The list in the node of that field, if nothing else uses or changes it.
    std::optional<List> listIn(Index node, std::string_view field) {
        for (const Index index : (*this)[node].items) {
            const Item& item = (*this)[index];
            if (item.kind != Kind::node || item.field != field) continue;
            if (isReferred(item) || item.items.size() != 1) return {};
            const Item& value = (*this)[item.items.front()];
            if (value.kind != Kind::value) return {};
            const Index at = item.items.front();
            if (auto list = listOf<Vec3f>(at, *value.value)) return list;
            if (auto list = listOf<Vec2f>(at, *value.value)) return list;
            if (auto list = listOf<Color>(at, *value.value)) return list;
            if (auto list = listOf<ColorRGBA>(at, *value.value)) return list;
            return listOf<Vec3d>(at, *value.value);
        }
        return {};
    }
    static constexpr const char* kNodes[] = {"coord", "normal", "color", "texCoord"};
    static constexpr const char* kIndex[] = {"coordIndex", "normalIndex", "colorIndex", "texCoordIndex"};

    bool hasOnly(Index node, std::initializer_list<std::string_view> fields) const {
        return std::ranges::all_of((*this)[node].items, [&](Index index) {
            const Item& item = (*this)[index];
            if (item.kind == Kind::connection) return false;
            const bool isNode = item.kind == Kind::node || item.kind == Kind::use;
            return !isNode || item.field == "metadata" || std::ranges::find(fields, item.field) != fields.end();
        });
    }
    void keep(const List& list, const std::vector<std::size_t>& kept) {
        Value& value = *(*this)[list.item].value;
        keepOnly<Vec3f>(value, kept);
        keepOnly<Vec2f>(value, kept);
        keepOnly<Color>(value, kept);
        keepOnly<ColorRGBA>(value, kept);
        keepOnly<Vec3d>(value, kept);
    }
    /// Gives each list indices of its own; one that has none gets a copy of those of the points.
    void separately(Index node) {
        if (!hasOnly(node, {"coord", "normal", "color", "texCoord"})) return;
        const Item* points = valueOf(node, "coordIndex");
        if (!points || !points->value->holds<Array<std::int32_t>>()) return;
        const Array<std::int32_t> original = points->value->as<Array<std::int32_t>>();
        for (std::size_t i = 0; i < std::size(kNodes); ++i) {
            const std::optional<List> list = listIn(node, kNodes[i]);
            if (!list || list->count == 0) continue;
            const Item* given = valueOf(node, kIndex[i]);
            const bool perVertex = isPerVertex(node, kNodes[i]);
            if (i > 0 && !perVertex) continue;  // one a face: in order, or with indices of faces
            Array<std::int32_t> indices = given ? given->value->as<Array<std::int32_t>>() : original;
            if (indices.empty()) indices = original;
            reindex(node, kIndex[i], *list, std::move(indices));
        }
        // Attributes without indices used those of the points.
        for (std::size_t i = 1; i < std::size(kNodes); ++i)
            if (hasNode(node, kNodes[i]) && isPerVertex(node, kNodes[i]) && !hasIndices(node, kIndex[i]))
                setValue(node, kIndex[i], Value(original));
    }
    bool isPerVertex(Index node, std::string_view field) {
        const Item* flag = field == "normal"  ? valueOf(node, "normalPerVertex")
                           : field == "color" ? valueOf(node, "colorPerVertex")
                                              : nullptr;
        return !flag || !flag->value->holds<bool>() || flag->value->as<bool>();
    }
    bool hasNode(Index node, std::string_view field) const {
        return std::ranges::any_of((*this)[node].items, [&](Index index) {
            const Item& item = (*this)[index];
            return (item.kind == Kind::node || item.kind == Kind::use) && item.field == field;
        });
    }
    bool hasIndices(Index node, std::string_view field) {
        const Item* item = valueOf(node, field);
        return item && item->value->holds<Array<std::int32_t>>() && !item->value->as<Array<std::int32_t>>().empty();
    }
    void reindex(Index node, const char* field, const List& list, Array<std::int32_t> indices) {
        if (std::ranges::any_of(indices.span(), [&](std::int32_t i) {
                return i < -1 || (i >= 0 && static_cast<std::size_t>(i) >= list.count);
            }))
            return;
        const Distinct result = distinct({list});
        if (result.kept.size() == list.count) return;
        std::int32_t* const out = indices.mutableData();
        for (std::size_t i = 0; i < indices.size(); ++i)
            if (out[i] >= 0) out[i] = result.now[static_cast<std::size_t>(out[i])];
        keep(list, result.kept);
        setValue(node, field, Value(std::move(indices)));
    }
    /// Triangles and quads: all attributes of a corner share one index, so the lists have equal lengths.
    void together(Index node) {
        if (!hasOnly(node, {"coord", "normal", "color", "texCoord"}) || !isPerVertex(node, "normal") ||
            !isPerVertex(node, "color"))
            return;
        std::vector<List> lists;
        for (const char* field : kNodes) {
            if (!hasNode(node, field)) continue;
            const std::optional<List> list = listIn(node, field);
            if (!list || (!lists.empty() && list->count != lists.front().count)) return;
            lists.push_back(*list);
        }
        if (lists.empty() || lists.front().count == 0 || !hasNode(node, "coord")) return;
        Item& item = (*this)[node];
        const bool isIndexed = item.name.starts_with("Indexed");
        Array<std::int32_t> indices;
        if (isIndexed) {
            const Item* given = valueOf(node, "index");
            if (!given || !given->value->holds<Array<std::int32_t>>()) return;
            indices = given->value->as<Array<std::int32_t>>();
        } else {
            const std::size_t corners = item.name == "QuadSet" ? 4 : 3;
            indices.resize(lists.front().count / corners * corners);
            std::iota(indices.mutableData(), indices.mutableData() + indices.size(), 0);
        }
        if (std::ranges::any_of(indices.span(), [&](std::int32_t i) {
                return i < 0 || static_cast<std::size_t>(i) >= lists.front().count;
            }))
            return;
        const Distinct result = distinct(lists);
        if (isIndexed && result.kept.size() == lists.front().count) return;
        if (!indices.empty()) {
            std::int32_t* const out = indices.mutableData();
            for (std::size_t i = 0; i < indices.size(); ++i) out[i] = result.now[static_cast<std::size_t>(out[i])];
        }
        for (const List& list : lists) keep(list, result.kept);
        if (!isIndexed) item.name = "Indexed" + item.name;
        setValue(node, "index", Value(std::move(indices)));
    }
    void setValue(Index node, const char* field, Value value) {
        if (Item* item = valueOf(node, field)) {
            item->value = std::move(value);
            return;
        }
        Item item{.kind = Kind::value, .where = (*this)[node].where, .end = (*this)[node].where};
        item.field = field;
        item.value = std::move(value);
        const Index index = add(std::move(item));
        std::vector<Index>& items = (*this)[node].items;
        items.insert(items.begin(), index);  // values stand before nodes
    }

    std::unordered_map<std::string, Uses> uses_;
};

}  // namespace

FilterPtr makeIndex(DocumentHandler& next) {
    return std::make_unique<IndexFilter>(next);
}

}  // namespace rtsg::detail
