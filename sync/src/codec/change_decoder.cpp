// Decodes records to change sets, block by block. Each row is checked and charged before memory is allocated for it.
#include <rtsg/sync/change_codec.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include "catalogue.h"
#include "columns/blocks.h"
#include "columns/column_codec.h"
#include "columns/column_rows.h"
#include "columns/packed_arrays.h"
#include "columns/wire.h"
#include "deflated_blocks.h"
#include "origin_hash.h"
#include "type_mapping.h"

namespace rtsg {

using wire::Reader;

namespace {

/// Overwrites the changes of the last record with those of this one. Most frames have as many changes as the last, and
/// destroying and constructing them would take as long as reading them.
class ChangesAnew {
  public:
    explicit ChangesAnew(ChangeSet& set) : set_(set), stale_(set.changes.size()) {}
    ~ChangesAnew() { set(); }
    ChangesAnew(const ChangesAnew&) = delete;
    ChangesAnew& operator=(const ChangesAnew&) = delete;
    /// The set without changes that are left of the last record. It may then be added to in any way.
    ChangeSet& set() {
        if (stale_ > 0) set_.changes.resize(set_.changes.size() - std::exchange(stale_, 0));
        return set_;
    }
    /// Adds so many changes. They may still have the content of the last record, so the caller sets everything in them.
    Change* add(std::size_t count) {
        const std::size_t first = set_.changes.size() - stale_;
        if (count > stale_) set_.changes.resize(first + count);
        stale_ -= std::min(stale_, count);
        return set_.changes.data() + first;
    }
    std::size_t capacity() const { return set_.changes.capacity(); }

  private:
    ChangeSet& set_;
    std::size_t stale_;  // number of changes at the end that are left of the last record
};

FieldIndex readField(Reader& in) {
    return static_cast<FieldIndex>(in.bounded(0xFFFF));
}

/// Reads a node number and the origin bit, which the simpler rows pack into one varint.
NodeId readNode(Reader& in, std::uint32_t& last, bool& external) {
    const std::uint64_t coded = in.varint();
    external = coded & 1;
    last = in.delta(coded >> 1, last);
    return NodeId{last};
}

void readDescriptions(Reader& in, std::size_t count, TypeMapping* mapping, OriginHash* hash) {
    if (!mapping) {  // both sides have the same types
        in.at = in.end;
        return;
    }
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        const std::uint64_t number = in.bounded(0xFFFF);
        const std::shared_ptr<const NodeType> type = wire::readType(in);
        if (type && !mapping->describe(static_cast<std::uint16_t>(number), type))
            in.refuse("description of what is no built-in type");
        else if (type && hash)
            hash->describe(static_cast<std::uint16_t>(number), type);
    }
}

void readTypes(Reader& in, std::size_t count, ChangeSet& set) {
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        const std::uint64_t coded = in.bounded(0x1FFFF);
        std::shared_ptr<const NodeType> type = wire::readType(in);
        if (!type) return;
        Change change = blankChange(ChangeKind::defineType, {}, kNoField, coded & 1);
        change.index = static_cast<std::uint32_t>(coded >> 1);
        set.changes.push_back(std::move(change));
        set.types.push_back({TypeIndex{static_cast<std::uint16_t>(coded >> 1)}, std::move(type)});
    }
}

/// Calls `fill(row, reader)` for each of so many new changes. They are made and filled in portions, so that each
/// portion is still in the nearest cache.
template <class Fill>
[[gnu::always_inline]] inline void readRows(Reader& in, std::size_t count, ChangesAnew& changes, const Fill& fill) {
    constexpr std::size_t kAtOnce = 256;
    for (std::size_t left = count; left > 0 && !in.problem;) {
        const std::size_t rows = std::min(left, kAtOnce);
        left -= rows;
        Change* const portion = changes.add(rows);
        Reader own = in;  // a local copy can stay in registers while changes are written
        for (std::size_t i = 0; i < rows; ++i) fill(portion[i], own);
        in = own;
    }
}

/// Sets everything but the value.
[[gnu::always_inline]] inline void setRow(Change& change, ChangeKind kind, NodeId node, FieldIndex field,
                                          bool external) {
    change.node = node;
    change.field = field;
    change.kind = kind;
    change.external = external;
    change.isConnection = false;
    change.other = {};
    change.index = 0;
}

void readCreates(Reader& in, std::size_t count, ChangesAnew& changes) {
    std::uint32_t last = 0, lastScope = 0;
    readRows(in, count, changes, [&](Change& change, Reader& rows) {
        bool external = false;
        const NodeId node = readNode(rows, last, external);
        setRow(change, ChangeKind::createNode, node, kNoField, external);
        change.index = static_cast<std::uint32_t>(rows.bounded(0xFFFF));
        lastScope = rows.delta(lastScope);
        change.other = NodeId{lastScope};
        change.value = {};
    });
}

void readLinks(Reader& in, std::size_t count, ChangeSet& set) {
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        const auto tag = in.number<std::uint8_t>();
        if (tag > (wire::kRemove | wire::kLinkExternal)) return in.refuse("unknown kind of link");
        last = in.delta(last);
        const FieldIndex field = readField(in);
        Change change = blankChange(ChangeKind::setField, NodeId{last}, field, tag & wire::kLinkExternal);
        switch (tag & 3) {
            case wire::kSetOne:
                change.value = NodeId{in.delta(last)};
                break;
            case wire::kSetMany: {
                const std::size_t many = in.count(1);
                if (many > 0 && !in.charge(wire::kArrayCost + many * sizeof(NodeId))) return;
                Array<NodeId> children = Array<NodeId>::ofSize(many);
                NodeId* target = children.mutableData();
                std::uint32_t previous = last;
                for (std::size_t k = 0; k < children.size() && !in.problem; ++k)
                    target[k] = NodeId{previous = in.delta(previous)};
                change.value = std::move(children);
                break;
            }
            default:
                change.kind = (tag & 3) == wire::kInsert ? ChangeKind::insertChild : ChangeKind::removeChild;
                change.other = NodeId{in.delta(last)};
                change.index = in.varint32();
        }
        set.changes.push_back(std::move(change));
    }
}

void readRoutes(Reader& in, std::size_t count, ChangeSet& set) {
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        const auto tag = in.number<std::uint8_t>();
        if (tag > (wire::kRouteRemove | wire::kRouteExternal | wire::kRouteIs)) return in.refuse("unknown route tag");
        last = in.delta(last);
        const FieldIndex field = readField(in);
        Change change = blankChange(tag & wire::kRouteRemove ? ChangeKind::removeRoute : ChangeKind::addRoute,
                                    NodeId{last}, field, tag & wire::kRouteExternal);
        change.isConnection = tag & wire::kRouteIs;
        change.other = NodeId{in.delta(last)};
        change.index = readField(in);
        set.changes.push_back(std::move(change));
    }
}

void readNames(Reader& in, std::size_t count, ChangeSet& set) {
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        bool external = false;
        const NodeId node = readNode(in, last, external);
        Change change = blankChange(ChangeKind::setName, node, kNoField, external);
        change.value = wire::readString(in);
        set.changes.push_back(std::move(change));
    }
}

void readDestroys(Reader& in, std::size_t count, ChangeSet& set) {
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        bool external = false;
        const NodeId node = readNode(in, last, external);
        set.changes.push_back(blankChange(ChangeKind::destroyNode, node, kNoField, external));
    }
}

void readEvents(Reader& in, std::size_t count, ChangeSet& set) {
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        bool external = false;
        const NodeId node = readNode(in, last, external);
        Change change = blankChange(ChangeKind::event, node, readField(in), external);
        const FieldType type = wire::readFieldType(in);
        change.value = wire::readValue(in, type);
        set.changes.push_back(std::move(change));
    }
}

void readAuthors(Reader& in, std::size_t count, ChangeSet& set) {
    const std::size_t authorsHere = in.count(1);
    if (in.problem || !in.charge(authorsHere * sizeof(String))) return;
    std::vector<String> names(authorsHere);
    for (String& name : names) name = wire::readString(in);
    if (count > in.left() / 3) return in.refuse("count exceeds the bytes that follow");
    auto authors = std::make_shared<std::vector<Authored>>();
    authors->reserve(count);
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        const std::uint64_t name = in.varint();
        if (name >= names.size()) return in.refuse("an author that is not named");
        last = in.delta(last);
        const std::uint64_t field = in.bounded(0x10000);
        authors->push_back({NodeId{last}, field ? static_cast<FieldIndex>(field - 1) : kNoField, names[name]});
    }
    if (!in.problem && count > 0) set.authors = std::move(authors);
}

/// Reads rows of values of at most 16 bytes. This is the hot path: running pointers, and no branch on the type inside
/// the loop.
template <class T>
void readPlainRows(Reader& in, std::size_t count, const std::byte* values, FieldIndex field, bool external,
                   ChangesAnew& changes) {
    constexpr std::size_t kAhead = 1024;  // bytes to prefetch; with many replicas, changes are not cached
    std::uint32_t last = 0;
    readRows(in, count, changes, [&](Change& change, Reader& rows) {
        __builtin_prefetch(reinterpret_cast<const std::byte*>(&change) + kAhead, 1);
        last = rows.delta(last);
        setRow(change, ChangeKind::setField, NodeId{last}, field, external);
        change.value.setPlain(FieldTypeOf<T>::value, values, sizeof(T));
        values += sizeof(T);
    });
}

/// Reads values of one fixed size.
template <class T>
void readFixed(Reader& in, std::size_t count, FieldIndex field, bool external, ChangesAnew& changes) {
    if (in.left() / (sizeof(T) + 1) < count) return in.refuse("column cut short");
    const std::byte* values = in.end - count * sizeof(T);
    const std::byte* const end = in.end;
    in.end = values;
    if constexpr (std::is_same_v<T, bool>) {
        const auto isNone = [](std::byte b) { return std::to_integer<unsigned>(b) > 1; };
        if (std::any_of(values, end, isNone)) in.refuse("boolean is neither 0 nor 1");
    }
    if constexpr (sizeof(T) <= sizeof(Vec4f)) {
        readPlainRows<T>(in, count, values, field, external, changes);
    } else {
        ChangeSet& set = changes.set();
        std::uint32_t last = 0;
        for (std::size_t i = 0; i < count; ++i) {
            last = in.delta(last);
            T value;
            std::memcpy(static_cast<void*>(&value), values, sizeof(T));
            values += sizeof(T);
            Change& change = set.changes.emplace_back();
            change.node = NodeId{last};
            change.field = field;
            change.external = external;
            change.value = Value(std::move(value));
        }
    }
    if (in.problem) return;
    if (in.left()) return in.refuse("bytes between a column's nodes and values");
    in.at = in.end = end;
}

template <class T>
void readVarying(Reader& in, std::size_t count, FieldIndex field, bool external, ChangeSet& set) {
    const std::size_t first = set.changes.size();
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        last = in.delta(last);
        set.changes.push_back(blankChange(ChangeKind::setField, NodeId{last}, field, external));
    }
    for (std::size_t i = first; i < set.changes.size() && !in.problem; ++i)
        set.changes[i].value = wire::readValue(in, FieldTypeOf<T>::value);
}

template <class T>
void readColumn(Reader& in, std::size_t count, FieldIndex field, bool external, ChangesAnew& changes) {
    if constexpr (std::is_same_v<T, String> || std::is_same_v<T, Image> || !std::is_trivially_copyable_v<T>)
        readVarying<T>(in, count, field, external, changes.set());
    else
        readFixed<T>(in, count, field, external, changes);
}

void readPackedColumn(Reader& in, std::size_t count, const wire::ColumnHead& head, ChangeSet& set) {
    const std::size_t first = set.changes.size();
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        last = in.delta(last);
        set.changes.push_back(blankChange(ChangeKind::setField, NodeId{last}, head.field, head.external));
    }
    for (std::size_t i = first; i < set.changes.size() && !in.problem; ++i)
        set.changes[i].value = wire::readPacked(in, head.type);
}

/// More fields than this in one stream's memory are taken for an attack.
constexpr std::size_t kMaxFields = std::size_t{1} << 22;
/// Up to this many changes the capacity of a set doubles as it grows from record to record. Above, it is only as large
/// as needed.
constexpr std::size_t kDoubleUpTo = 32768;

/// A million changes are 40 MB of fresh memory. The system's page faults for small pages would take as long as reading
/// them.
void askForLargePages(void* memory, std::size_t size) {
#ifdef MADV_HUGEPAGE
    constexpr std::size_t kPays = std::size_t{4} << 20;
    if (size < kPays) return;
    const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
    const std::uintptr_t into = reinterpret_cast<std::uintptr_t>(memory) % page;
    // Only whole pages can be advised. Without the advice the program is only slower.
    (void)::madvise(static_cast<std::byte*>(memory) + (page - into) % page, size - page, MADV_HUGEPAGE);
#else
    (void)memory, (void)size;
#endif
}

/// Reserves memory for all rows at once, as a growing vector would hold them twice. Rows of predicted columns are not
/// charged, because their fields have been given before, and the number of those has its own limit.
void reserveRows(Reader& in, std::size_t remembered, ChangesAnew& changes) {
    std::uint64_t rows = 0, predicted = 0;
    Reader blocks = in;
    while (blocks.left() && !blocks.problem) {
        const auto kind = blocks.number<std::uint8_t>();
        const std::uint64_t count = blocks.varint();
        const Reader block = blocks.part(blocks.count(1));
        if (kind == wire::kDescriptions || kind >= wire::kBlockEnd || block.left() == 0) continue;
        const unsigned coding = kind == wire::kValues ? std::to_integer<unsigned>(*block.at) : wire::kCodingRaw;
        const bool raw = coding == wire::kCodingRaw || coding == wire::kCodingArrays;
        if (raw)
            rows += std::min<std::uint64_t>(count, block.left());
        else
            predicted += std::min<std::uint64_t>(count, remembered);
    }
    if (blocks.problem) return;  // whoever reads the blocks reports the place
    if (!in.charge(rows * wire::kChangeCost)) return;
    const std::size_t all = rows + std::min<std::uint64_t>(predicted, remembered);
    if (all <= changes.capacity()) return;
    const std::size_t doubled = 2 * changes.capacity();
    ChangeSet& set = changes.set();
    set.changes = {};
    set.changes.reserve(doubled <= kDoubleUpTo ? std::max(all, doubled) : all);
    askForLargePages(set.changes.data(), set.changes.capacity() * sizeof(Change));
}

/// Returns false if the column's coding is unknown; the column is then skipped. `columns` is null if nothing is
/// remembered.
bool readValues(Reader& in, std::size_t count, wire::ColumnReader* columns, ChangesAnew& changes) {
    const auto coding = in.number<std::uint8_t>();
    if (coding > wire::kCodingArrays) return in.problem != nullptr;
    const auto flags = in.number<std::uint8_t>();
    if (flags > wire::kValueExternal) in.refuse("unknown column flags");
    wire::ColumnHead head;
    head.external = flags & wire::kValueExternal;
    head.type = wire::readFieldType(in);
    if (sf(head.type) == FieldType::SFNode) in.refuse("a column of nodes");
    head.field = readField(in);
    if (in.problem) return true;
    if (coding == wire::kCodingPacked || coding == wire::kCodingRanged) {
        if (columns)
            columns->read(in, count, coding, head, changes.set());
        else
            in.refuse("predicted values in a record that remembers none");
        return true;
    }
    if (count > in.left()) in.refuse("count exceeds the bytes that follow");
    if (coding == wire::kCodingArrays) return readPackedColumn(in, count, head, changes.set()), true;
    const std::size_t first = columns ? changes.set().changes.size() : 0;
    switch (head.type) {
#define RTSG_X(suffix, T)                                                           \
    case FieldType::SF##suffix:                                                     \
        readColumn<T>(in, count, head.field, head.external, changes);               \
        break;                                                                      \
    case FieldType::MF##suffix:                                                     \
        readVarying<Array<T>>(in, count, head.field, head.external, changes.set()); \
        break;
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    if (!columns || in.problem) return true;
    if (wire::lanesOf(head.type) > 0 && columns->history().slots() + count > kMaxFields)
        in.refuse("more values than a reader remembers");
    else
        columns->remember(head, changes.set(), first);
    return true;
}

/// Returns false for a column in a coding of a later format.
bool readBlock(Reader& in, unsigned kind, std::size_t count, wire::ColumnReader* columns, ChangesAnew& changes) {
    if (kind == wire::kValues) return readValues(in, count, columns, changes);
    if (kind == wire::kCreate) return readCreates(in, count, changes), true;
    ChangeSet& set = changes.set();
    switch (kind) {
        case wire::kTypes:
            readTypes(in, count, set);
            break;
        case wire::kLinks:
            readLinks(in, count, set);
            break;
        case wire::kNames:
            readNames(in, count, set);
            break;
        case wire::kRoutes:
            readRoutes(in, count, set);
            break;
        case wire::kDestroy:
            readDestroys(in, count, set);
            break;
        case wire::kEvents:
            readEvents(in, count, set);
            break;
        case wire::kAuthors:
            readAuthors(in, count, set);
            break;
        default:
            break;
    }
    return true;
}

Result<RecordHeader> headerOfChanges(std::span<const std::byte> record) {
    Result<RecordHeader> header = parseRecordHeader(record);
    if (!header) return header;
    const bool isFrame = header->kind == RecordKind::frame;
    if (!isFrame && header->kind != RecordKind::keyframe && header->kind != RecordKind::scene)
        return fail(fmt::format("record of kind {} holds no changes", static_cast<unsigned>(header->kind)));
    if ((header->from == 0) == isFrame)
        return fail(fmt::format("a {} cannot start at state {}", isFrame ? "frame" : "keyframe", header->from));
    if (header->to < header->from)
        return fail(fmt::format("changes lead back from state {} to {}", header->from, header->to));
    return header;
}

}  // namespace

ChangeDecoder::ChangeDecoder(TypeTable local) : ChangeDecoder(local, rtsg::dictionaryHash(local)) {}
ChangeDecoder::ChangeDecoder(TypeTable local, std::uint64_t localHash) : local_(local), localHash_(localHash) {}
ChangeDecoder::~ChangeDecoder() = default;

Result<> ChangeDecoder::setHead(const StreamHead& head) {
    columns_.reset();
    // A stream that goes on does not describe its types again, and its nodes keep their types.
    const std::array<std::uint64_t, 4> stream{head.epoch, head.dictionaryHash, head.builtinTypes, head.formatVersion};
    const bool counts = counting_ && (mapping_ || head.formatVersion < kFormatVersion);
    if (std::exchange(stream_, stream) == stream && counts == (origin_ != nullptr)) return {};
    mapping_.reset();
    origin_.reset();
    if (head.dictionaryHash != localHash_) mapping_ = std::make_shared<TypeMapping>(local_, head.builtinTypes);
    if (counting_ && (mapping_ || head.formatVersion < kFormatVersion))
        origin_ = std::make_unique<OriginHash>(head, mapping_ ? TypeTable() : local_);
    return {};
}

FieldIndex ChangeDecoder::fieldAtWriter(NodeId node, FieldIndex field) const {
    return mapping_ ? mapping_->fieldAtOrigin(node, field) : field;
}

std::optional<Hash128> ChangeDecoder::originHash() const {
    return origin_ ? std::optional(origin_->value()) : std::nullopt;
}

void ChangeDecoder::countRun(const ChangeSet& set) {
    if (!origin_) return;
    if (!mapping_) return origin_->follow(set);
    const ChangeSet there = mapping_->toOrigin(set);
    for (const Change& change : there.changes)  // whose types the inputs may have described
        if (change.kind == ChangeKind::createNode && mapping_->isBuiltin(change.index))
            origin_->describe(static_cast<std::uint16_t>(change.index), mapping_->description(change.index));
    origin_->follow(there);
}

std::string ChangeDecoder::lackingHere() const {
    return mapping_ ? mapping_->lackingHere() : std::string();
}

void ChangeDecoder::goOnFrom(const ChangeDecoder& other) {
    columns_.reset();
    if (!other.columns_) return;
    columns_ = std::make_unique<wire::ColumnReader>();
    columns_->history() = other.columns_->history().clone();
}

/// Returns null if the record has no effect on remembered values.
wire::ColumnReader* ChangeDecoder::columnsFor(const RecordHeader& header) {
    if (header.kind != RecordKind::frame) {
        if (columns_) columns_->history().clear();
        return nullptr;
    }
    if (!(header.flags & kRemember)) return nullptr;
    if (!columns_) columns_ = std::make_unique<wire::ColumnReader>();
    columns_->begin(header.flags);
    return columns_.get();
}

Result<> ChangeDecoder::readBlocks(Reader& in, wire::ColumnReader* columns, ChangeSet& set) {
    ChangesAnew changes(set);
    reserveRows(in, columns ? columns->history().slots() : 0, changes);
    unsigned previous = 0;
    bool any = false;
    while (in.left() && !in.problem) {
        const auto kind = in.number<std::uint8_t>();
        const std::uint64_t count = in.varint();
        Reader block = in.part(in.count(1));
        if (in.problem) break;
        if (kind >= wire::kBlockEnd) {
            losses_.blocks += kind == wire::kFiller ? 0 : 1;
            continue;
        }
        if (any && (kind < previous || (kind == previous && kind != wire::kValues)))
            block.refuse("blocks out of order");
        // A predicted value may take less than a byte, so columns have another bound.
        if (kind != wire::kValues && count > block.left()) block.refuse("count exceeds the bytes that follow");
        previous = kind;
        any = true;
        if (kind == wire::kDescriptions) {
            readDescriptions(block, count, mapping_.get(), origin_.get());
        } else if (!readBlock(block, kind, count, columns, changes)) {
            ++losses_.blocks;
            continue;
        }
        if (!block.problem && block.left()) block.refuse("bytes after a block's last change");
        if (block.problem) return std::unexpected(wire::describe(block, "change"));
    }
    if (in.problem) return std::unexpected(wire::describe(in, "block"));
    return {};
}

/// Reads what a scene record has before its blocks. From then on type numbers are the catalogue's.
void ChangeDecoder::readSceneStart(Reader& in) {
    const auto version = in.number<std::uint16_t>(), builtins = in.number<std::uint16_t>(),
               root = in.number<std::uint16_t>();
    if (in.problem) return;
    if (version != wire::kSceneVersion) return in.refuse("version unknown to this reader");
    StreamHead head;
    head.builtinTypes = builtins;
    mapping_ = std::make_shared<TypeMapping>(local_, builtins);
    origin_ = counting_ ? std::make_unique<OriginHash>(head, TypeTable()) : nullptr;
    if (!describeFromCatalogue(root, *in.budget)) in.refuse("a root whose type is not in the catalogue");
}

/// Returns false if this program has no such entry.
bool ChangeDecoder::describeFromCatalogue(std::uint16_t number, wire::Budget& budget) {
    const std::shared_ptr<const NodeType> type = wire::catalogueType(number);
    if (!type || !budget.take(wire::costOf(*type)) || !mapping_->describe(number, type)) return false;
    if (origin_) origin_->describe(number, type);
    return true;
}

Result<> ChangeDecoder::describeTypesOf(const ChangeSet& set, wire::Budget& budget) {
    for (const Change& change : set.changes) {
        if (change.kind != ChangeKind::createNode || mapping_->knows(change.index)) continue;
        const bool isKnown = change.index < wire::catalogueSize();
        const auto number = static_cast<std::uint16_t>(change.index);
        if (isKnown && mapping_->isBuiltin(change.index) && !describeFromCatalogue(number, budget))
            return fail("types take more memory than a record of this length may");
        if (!isKnown && mapping_->isBuiltin(change.index))
            return fail(
                fmt::format("it has nodes of type {} of the catalogue, and this program knows the first {}: a later "
                            "version wrote it",
                            change.index, wire::catalogueSize()));
    }
    return {};
}

Result<> ChangeDecoder::decode(std::span<const std::byte> record, ChangeSet& set) {
    const Result<RecordHeader> header = headerOfChanges(record);
    if (!header) return std::unexpected(header.error());
    set.from = header->from;
    set.to = header->to;
    set.time = header->time;
    set.hash = header->hash;
    set.types.clear();
    set.input.reset();
    set.authors.reset();
    wire::ColumnReader* columns = columnsFor(*header);
    wire::Budget budget(header->size());
    Reader in(record.subspan(kRecordHeaderSize, header->length), kRecordHeaderSize);
    in.budget = &budget;
    const bool isScene = header->kind == RecordKind::scene;
    if (header->kind != RecordKind::frame) set.changes.clear();  // frames overwrite the changes that are there
    if (isScene) readSceneStart(in);
    if (in.problem) return std::unexpected(wire::describe(in, "scene"));
    const std::optional<std::vector<std::byte>> inflated =
        wire::inflateBlocks(in, isScene ? wire::sceneWords() : std::span<const std::byte>());
    if (in.problem) {
        set.changes.clear();
        return std::unexpected(wire::describe(in, "block"));
    }
    if (inflated) in = Reader(*inflated, kRecordHeaderSize);
    in.budget = &budget;
    if (auto ok = readBlocks(in, columns, set); !ok) return ok;
    if (isScene) {
        if (auto ok = describeTypesOf(set, budget); !ok) return ok;
        if (mapping_->sameHere()) {
            const std::shared_ptr<TypeMapping> mapping = std::exchange(mapping_, nullptr);
            origin_.reset();
            return mapping->renumber(set);
        }
    }
    if (origin_) origin_->follow(set);
    return mapping_ ? mapping_->toLocal(set, budget, refusing_ ? nullptr : &losses_) : Result<>{};
}

}  // namespace rtsg
