// Encodes change sets as records: sorts rows into blocks and values into columns, and predicts some of the values.
#include <rtsg/sync/change_codec.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "catalogue.h"
#include "columns/blocks.h"
#include "columns/column_codec.h"
#include "columns/column_rows.h"
#include "columns/packed_arrays.h"
#include "columns/wire.h"
#include "deflated_blocks.h"

namespace rtsg {

using wire::zigzag;

namespace {

/// The encoded rows of one kind of change, in order.
struct Rows {
    ByteBuffer bytes;
    std::uint64_t count = 0;
    std::uint32_t lastNode = 0, lastOther = 0;

    void clear() {
        bytes.clear();
        count = 0;
        lastNode = lastOther = 0;
    }
    std::uint64_t step(NodeId node) {
        const std::uint64_t coded = zigzag(node.value, lastNode);
        lastNode = node.value;
        ++count;
        return coded;
    }
};

/// One frame in so many has kSync, so that readers can start there without the frames before.
constexpr unsigned kSyncEvery = 32;
/// The writer forgets all fields when it remembers this many, unless a single frame has as many.
constexpr std::size_t kMaxRemembered = std::size_t{1} << 20;
/// Frames with more changes are not predicted, because readers remember only this many fields and those of a few
/// frames.
constexpr std::size_t kMaxPredicted = std::size_t{1} << 20;

/// Shorter arrays are not packed, because the description of the packing takes more bytes than it saves.
constexpr std::size_t kFewest = 8;
/// Up to this many bytes, packed arrays are deflated as well.
constexpr std::size_t kMaxDeflated = std::size_t{1} << 20;

/// A bit of a column's key, beside wire::kValueExternal.
constexpr unsigned kPackedKey = 2;

/// Value changes of one (field, type, origin). Packed arrays have a column apart from other arrays.
struct Column {
    std::uint32_t key = 0;  // field number, type, and bits
    FieldType type = FieldType::SFBool;
    std::uint8_t elementSize = 0;  // 0 if values vary in size
    std::uint32_t lastNode = 0;
    std::uint64_t count = 0;
    bool predicted = false;  // if true, `numbers` holds the nodes, else `nodes`
    bool packed = false;     // its values are packed arrays
    std::size_t lead = 0;    // bytes before the values in its block, when writeRun() last wrote it
    std::vector<std::uint32_t> numbers;
    ByteBuffer nodes, values;

    void clear() {
        lastNode = 0;
        count = 0;
        numbers.clear();
        nodes.clear();
        values.clear();
    }
};

std::uint32_t keyOf(const Change& change, bool packed) {
    return std::uint32_t{change.field} << 16 | static_cast<std::uint32_t>(change.value.type()) << 8 |
           (change.external ? wire::kValueExternal : 0u) | (packed ? kPackedKey : 0u);
}

bool isWorthPacking(const Value& value) {
    if (wire::packedLanes(value.type()) == 0) return false;
    const detail::ArrayHeader* header = nullptr;
    std::memcpy(&header, value.storage(), sizeof(header));
    return header && header->size >= kFewest;
}

std::byte* writeVarint(std::byte* at, std::uint64_t number) {
    while (number >= 0x80) {
        *at++ = static_cast<std::byte>(number | 0x80);
        number >>= 7;
    }
    *at++ = static_cast<std::byte>(number);
    return at;
}

}  // namespace

struct ChangeEncoder::Parts {
    Parts(const StreamMode& streamMode, TypeTable table)
        : mode(streamMode), types(table), described(table.size()), writer(streamMode) {
        const auto scene = std::ranges::find(types, "RtsgScene", [](const auto& t) -> const auto& { return t->name; });
        rootType = static_cast<std::size_t>(scene - types.begin());
    }

    StreamMode mode;
    TypeTable types;
    std::size_t rootType = 0;
    std::vector<bool> described;  // by type, since the last keyframe
    wire::ColumnWriter writer;
    bool forget = true;  // the next frame has kForget
    unsigned sinceSync = 0;
    std::size_t predicted = 0;  // number of predicted values in the last frame
    bool predicting = false;    // this frame has predicted values
    bool makesSmall = false;
    std::vector<std::uint16_t> catalogued;  // in a scene file: the catalogue's number of each built-in type
    std::uint64_t descriptions = 0;         // what a reader is charged for the set's descriptions
    std::array<Rows, wire::kBlockEnd> rows;
    std::vector<std::string_view> authors;  // of the present set
    std::vector<Column> columns;            // the first `used` belong to the present set
    std::size_t used = 0;
    std::array<std::uint16_t, 64> recent{};  // maps hashes of keys to columns; a guess to be checked

    void clear() {
        for (Rows& r : rows) r.clear();
        used = 0;
        descriptions = 0;
        authors.clear();
    }
    /// Frees the memory that a snapshot took, as frames do not need it.
    void release() {
        for (Rows& r : rows) r = Rows();
        columns = std::vector<Column>();
        used = 0;
    }

    /// The memory that decoding the present set takes. If it is far below the limit, this is a quick upper bound.
    std::uint64_t cost(const ChangeSet& set, std::size_t recordSize, std::uint64_t inflated) const {
        constexpr std::uint64_t kMaxForAByte = 128;  // a field of a type takes at least 6 bytes, a text at least 1
        const std::uint64_t changes =
            (set.changes.size() + (set.authors ? set.authors->size() : 0)) * wire::kChangeCost;
        const std::uint64_t maximum = changes + recordSize * kMaxForAByte;
        if (!makesSmall && maximum <= wire::Budget(recordSize).left) return maximum;
        std::uint64_t result = changes + descriptions + inflated;
        for (const Change& change : set.changes) result += wire::costOf(change.value);
        for (const DefinedType& type : set.types)
            if (type.type) result += wire::costOf(*type.type);
        for (const std::string_view name : authors)
            result += sizeof(String) + (name.empty() ? 0 : wire::kArrayCost + name.size());
        return result;
    }

    Column& column(std::uint32_t key, FieldType type) {
        std::uint16_t& guess = recent[(key >> 16 ^ key >> 6 ^ key) & 63];
        if (guess < used && columns[guess].key == key) return columns[guess];
        const auto first = columns.begin();
        const auto last = first + static_cast<std::ptrdiff_t>(used);
        auto found = std::find_if(first, last, [key](const Column& c) { return c.key == key; });
        if (found == last) {
            if (used == columns.size()) columns.emplace_back();
            found = columns.begin() + static_cast<std::ptrdiff_t>(used++);
            found->key = key;
            found->type = type;
            found->elementSize = wire::fixedSize(type) ? info(type).elementSize : 0;
            found->predicted = predicting && wire::lanesOf(type) > 0;
            found->packed = key & kPackedKey;
            found->clear();
        }
        guess = static_cast<std::uint16_t>(found - columns.begin());
        return *found;
    }

    void describe(std::size_t type) {
        if (type >= described.size() || described[type]) return;
        described[type] = true;
        descriptions += wire::costOf(*types[type]);
        if (!catalogued.empty()) return;
        Rows& r = rows[wire::kDescriptions];
        ++r.count;
        r.bytes.putVarint(type);
        wire::putType(r.bytes, *types[type]);
    }

    /// The number that the record uses for a type of this program.
    std::uint64_t numberOf(std::uint32_t type) const {
        if (catalogued.empty()) return type;
        return type < catalogued.size() ? catalogued[type] : type - catalogued.size() + wire::catalogueSize();
    }
    /// Returns false if the catalogue lacks a built-in type of the snapshot.
    bool takeNumbersOfCatalogue(const ChangeSet& snapshot) {
        constexpr std::uint16_t kUnknown = 0xFFFF;
        std::vector<std::uint16_t> numbers(types.size(), kUnknown);
        const auto find = [&](std::size_t type) {
            if (type >= numbers.size() || numbers[type] != kUnknown) return true;
            const std::optional<std::uint16_t> number = wire::catalogueNumber(*types[type]);
            numbers[type] = number.value_or(kUnknown);
            return number.has_value();
        };
        if (rootType >= types.size() || !find(rootType)) return false;
        for (const Change& change : snapshot.changes)
            if (change.kind == ChangeKind::createNode && !find(change.index)) return false;
        catalogued = std::move(numbers);
        return true;
    }

    void addValue(const Change& change) {
        Column& c = column(keyOf(change, makesSmall && isWorthPacking(change.value)), change.value.type());
        if (c.predicted) {
            c.numbers.push_back(change.node.value);
        } else {
            c.nodes.setEnd(writeVarint(c.nodes.room(10), zigzag(change.node.value, c.lastNode)));
            c.lastNode = change.node.value;
        }
        ++c.count;
        if (c.packed) return wire::putPacked(c.values, change.value);
        if (c.elementSize == 0) return wire::putValue(c.values, change.value);
        std::byte* target = c.values.room(c.elementSize < 16 ? 16u : c.elementSize);
        // 16 bytes of storage are readable for every type (longer ones are padded); copying a fixed count is fastest.
        if (c.elementSize <= 16)
            std::memcpy(target, change.value.storage(), 16);
        else
            std::memcpy(target, change.value.storage(), c.elementSize);
        c.values.advance(c.elementSize);
    }

    /// The column of the first change, if that is a plain value; else null.
    Column* columnOfRun(const Change& first) {
        const FieldType type = first.value.type();
        if (first.kind != ChangeKind::setField || !wire::fixedSize(type) || type == FieldType::SFNode) return nullptr;
        Column& c = column(keyOf(first, false), type);
        return c.predicted ? nullptr : &c;
    }
    /// Adds the plain values at the front that belong to one column. Returns how many there are, possibly 0.
    std::size_t addValuesRun(std::span<const Change> changes) {
        Column* const c = columnOfRun(changes.front());
        return c ? fillColumn(*c, changes, c->values) : 0;
    }
    static constexpr std::size_t kAtOnce = 256;  // values between two checks of the free room
    /// A quick guess: if the first and the last change belong to one column, those between mostly do, too.
    bool mayBeOneRun(const ChangeSet& set) const {
        if (set.isSnapshot() || makesSmall || set.authors || set.changes.empty()) return false;
        const Change &first = set.changes.front(), &last = set.changes.back();
        return first.kind == last.kind && keyOf(first, false) == keyOf(last, false);
    }
    /// Writes a frame whose changes are all values of one column straight into the record. It guesses that the values
    /// start where they did in the last frame, and moves them if the bytes before them turn out to have another length.
    /// Returns how many changes were taken: all of them, or only the first ones, which are then in the column as after
    /// addValuesRun().
    std::size_t writeRun(std::span<const Change> changes, ByteBuffer& record) {
        Column* const c = columnOfRun(changes.front());
        if (!c) return 0;
        const std::size_t guess = kRecordHeaderSize + c->lead;
        record.clear();
        record.room(guess + (changes.size() + kAtOnce) * c->elementSize);
        record.advance(guess);
        const std::size_t taken = fillColumn(*c, changes, record);
        const std::size_t size = taken * c->elementSize;
        if (taken < changes.size()) {
            c->values.append(record.data() + guess, size);
            return taken;
        }
        c->lead = leadOf(*c, size);
        const std::size_t begin = kRecordHeaderSize + c->lead;
        if (begin != guess) {
            record.room(c->lead);
            std::memmove(record.data() + begin, record.data() + guess, size);
        }
        record.setEnd(record.data() + kRecordHeaderSize);
        putLead(*c, size, record);
        record.advance(size);
        return taken;
    }

    /// Appends to `to` the values at the front that belong to the column, and returns how many there are.
    static std::size_t fillColumn(Column& c, std::span<const Change> changes, ByteBuffer& to) {
        switch (c.elementSize) {
            case 1:
                return fillColumn<1>(c, changes, to);
            case 4:
                return fillColumn<4>(c, changes, to);
            case 8:
                return fillColumn<8>(c, changes, to);
            case 12:
                return fillColumn<12>(c, changes, to);
            case 16:
                return fillColumn<16>(c, changes, to);
            default:
                return 0;
        }
    }
    /// Works on local variables only, because the compiler must assume that the written bytes alias everything else.
    template <std::size_t size>
    static std::size_t fillColumn(Column& c, std::span<const Change> changes, ByteBuffer& to) {
        constexpr std::size_t kLongestStep = 5, kAhead = 1024;
        const Change& like = changes.front();
        const FieldType type = like.value.type();
        std::uint32_t last = c.lastNode;
        std::size_t i = 0;
        for (bool more = true; more && i < changes.size();) {
            std::byte* nodes = c.nodes.room(kAtOnce * kLongestStep);
            std::byte* values = to.room(kAtOnce * size);
            const std::size_t end = std::min(i + kAtOnce, changes.size());
            for (; i < end; ++i) {
                const Change& change = changes[i];
                more = change.field == like.field && change.kind == ChangeKind::setField &&
                       change.external == like.external && change.value.type() == type;
                if (!more) break;
                nodes = writeVarint(nodes, zigzag(change.node.value, last));
                last = change.node.value;
                __builtin_prefetch(values + kAhead, 1);
                std::memcpy(values, change.value.storage(), size);
                values += size;
            }
            c.nodes.setEnd(nodes);
            to.setEnd(values);
        }
        c.lastNode = last;
        c.count += i;
        return i;
    }

    void addLink(const Change& change) {
        Rows& r = rows[wire::kLinks];
        const unsigned external = change.external ? wire::kLinkExternal : 0u;
        const auto start = [&](unsigned op) {
            r.bytes.put(static_cast<std::uint8_t>(op | external));
            r.bytes.putVarint(r.step(change.node));
            r.bytes.putVarint(change.field);
        };
        if (change.kind == ChangeKind::insertChild || change.kind == ChangeKind::removeChild) {
            start(change.kind == ChangeKind::insertChild ? wire::kInsert : wire::kRemove);
            r.bytes.putVarint(zigzag(change.other.value, change.node.value));
            r.bytes.putVarint(change.index);
        } else if (change.value.holds<NodeId>()) {
            start(wire::kSetOne);
            r.bytes.putVarint(zigzag(change.value.as<NodeId>().value, change.node.value));
        } else {
            start(wire::kSetMany);
            const Array<NodeId>& children = change.value.as<Array<NodeId>>();
            r.bytes.putVarint(children.size());
            std::uint32_t previous = change.node.value;
            for (const NodeId child : children) {
                r.bytes.putVarint(zigzag(child.value, previous));
                previous = child.value;
            }
        }
    }

    void addRoute(const Change& change) {
        Rows& r = rows[wire::kRoutes];
        r.bytes.put(static_cast<std::uint8_t>((change.kind == ChangeKind::removeRoute ? wire::kRouteRemove : 0) |
                                              (change.external ? wire::kRouteExternal : 0) |
                                              (change.isConnection ? wire::kRouteIs : 0)));
        r.bytes.putVarint(r.step(change.node));
        r.bytes.putVarint(change.field);
        r.bytes.putVarint(zigzag(change.other.value, change.node.value));
        r.bytes.putVarint(change.field2());
    }

    void addAuthors(const std::vector<Authored>& all) {
        for (const Authored& one : all)
            if (std::ranges::find(authors, one.author.view()) == authors.end()) authors.push_back(one.author.view());
        Rows& r = rows[wire::kAuthors];
        r.bytes.putVarint(authors.size());
        for (const std::string_view name : authors) wire::putText(r.bytes, name);
        for (const Authored& one : all) {
            r.bytes.putVarint(
                static_cast<std::uint64_t>(std::ranges::find(authors, one.author.view()) - authors.begin()));
            r.bytes.putVarint(r.step(one.node));
            r.bytes.putVarint(one.field == kNoField ? 0u : one.field + 1u);
        }
    }

    // ---- the blocks -----------------------------------------------------------------------------------------------

    std::size_t maxBytes() const {
        std::size_t size = kRecordHeaderSize;
        for (const Rows& r : rows) size += r.bytes.size() + 32;
        for (std::size_t i = 0; i < used; ++i) size += columns[i].nodes.size() + columns[i].values.size() + 64;
        return size;
    }
    static void putBlock(wire::Block block, std::uint64_t count, std::size_t length, ByteBuffer& out) {
        out.put(static_cast<std::uint8_t>(block));
        out.putVarint(count);
        out.putVarint(length);
    }
    void putRows(unsigned block, ByteBuffer& out) const {
        const Rows& r = rows[block];
        if (r.count == 0) return;
        putBlock(static_cast<wire::Block>(block), r.count, r.bytes.size(), out);
        out.append(r.bytes.bytes());
    }
    void putColumn(const Column& c, ByteBuffer& out) {
        const std::uint64_t field = c.key >> 16;
        if (c.predicted) {
            predicted += c.numbers.size();
            writer.write({static_cast<FieldIndex>(field), c.type, (c.key & wire::kValueExternal) != 0}, c.numbers,
                         reinterpret_cast<const float*>(c.values.data()), out);
            return;
        }
        putLead(c, c.values.size(), out);
        out.append(c.values.bytes());
    }
    /// Bytes of an unpredicted column's block behind the block's length; `values` is the size of its values.
    static std::size_t lengthOf(const Column& c, std::size_t values) {
        return 3 + wire::varintSize(c.key >> 16) + c.nodes.size() + values;
    }
    static std::size_t leadOf(const Column& c, std::size_t values) {
        const std::size_t length = lengthOf(c, values);
        return 1 + wire::varintSize(c.count) + wire::varintSize(length) + length - values;
    }
    static void putLead(const Column& c, std::size_t values, ByteBuffer& out) {
        putBlock(wire::kValues, c.count, lengthOf(c, values), out);
        out.put(static_cast<std::uint8_t>(c.packed ? wire::kCodingArrays : wire::kCodingRaw));
        out.put(static_cast<std::uint8_t>(c.key & wire::kValueExternal));
        out.put(static_cast<std::uint8_t>(c.type));
        out.putVarint(c.key >> 16);
        out.append(c.nodes.bytes());
    }
    std::uint64_t put(ByteBuffer& out) {
        for (unsigned block = wire::kDescriptions; block < wire::kBlockEnd; ++block) {
            putRows(block, out);
            for (std::size_t i = 0; block == wire::kValues && i < used; ++i) putColumn(columns[i], out);
        }
        return 0;
    }
    /// Deflates everything, except packed arrays if they are large: inflating those takes longer than reading them
    /// packed. Returns the bytes that a reader inflates.
    std::uint64_t putSmall(ByteBuffer& out) {
        ByteBuffer before, after;
        std::size_t packed = 0;
        for (std::size_t i = 0; i < used; ++i) packed += columns[i].packed ? columns[i].values.size() : 0;
        const bool all = packed <= kMaxDeflated;
        for (unsigned block = wire::kDescriptions; block < wire::kBlockEnd; ++block) {
            putRows(block, all || block < wire::kValues ? before : after);
            for (std::size_t i = 0; block == wire::kValues && i < used; ++i)
                if (all || !columns[i].packed) putColumn(columns[i], before);
        }
        const auto words = catalogued.empty() ? std::span<const std::byte>() : wire::sceneWords();
        const std::uint64_t inflated = wire::putDeflated(before.bytes(), out, words);
        if (all) return inflated;
        for (std::size_t i = 0; i < used; ++i)
            if (columns[i].packed) putColumn(columns[i], out);
        return inflated + wire::putDeflated(after.bytes(), out, words);
    }

    /// Call it when all blocks are written.
    void seal(const ChangeSet& set, std::uint8_t flags, std::uint64_t inflated, ByteBuffer& record) const {
        wire::fillUp(record, cost(set, record.size(), inflated));
        RecordHeader header;
        header.kind = !catalogued.empty() ? RecordKind::scene
                      : set.isSnapshot()  ? RecordKind::keyframe
                                          : RecordKind::frame;
        header.flags = flags;
        header.from = set.from;
        header.to = set.to;
        header.time = set.time;
        header.hash = set.hash;
        sealRecord(record, header);
    }

    void add(const ChangeSet& set, const Change& change) {
        const std::uint64_t external = change.external;
        switch (change.kind) {
            case ChangeKind::defineType: {
                const auto defined = std::ranges::find_if(
                    set.types, [&](const DefinedType& d) { return d.index.value == change.index; });
                if (defined == set.types.end() || !defined->type) break;  // the set cannot be applied
                Rows& r = rows[wire::kTypes];
                ++r.count;
                r.bytes.putVarint(numberOf(change.index) << 1 | external);
                wire::putType(r.bytes, *defined->type);
                break;
            }
            case ChangeKind::createNode: {
                describe(change.index);
                Rows& r = rows[wire::kCreate];
                r.bytes.putVarint(r.step(change.node) << 1 | external);
                r.bytes.putVarint(numberOf(change.index));
                r.bytes.putVarint(zigzag(change.other.value, r.lastOther));
                r.lastOther = change.other.value;
                break;
            }
            case ChangeKind::setField:
                if (sf(change.value.type()) == FieldType::SFNode)
                    addLink(change);
                else
                    addValue(change);
                break;
            case ChangeKind::insertChild:
            case ChangeKind::removeChild:
                addLink(change);
                break;
            case ChangeKind::setName: {
                Rows& r = rows[wire::kNames];
                r.bytes.putVarint(r.step(change.node) << 1 | external);
                wire::putText(r.bytes, change.value.holds<String>() ? change.value.as<String>().view() : "");
                break;
            }
            case ChangeKind::addRoute:
            case ChangeKind::removeRoute:
                addRoute(change);
                break;
            case ChangeKind::destroyNode: {
                Rows& r = rows[wire::kDestroy];
                r.bytes.putVarint(r.step(change.node) << 1 | external);
                break;
            }
            case ChangeKind::event: {
                Rows& r = rows[wire::kEvents];
                r.bytes.putVarint(r.step(change.node) << 1 | external);
                r.bytes.putVarint(change.field);
                r.bytes.put(static_cast<std::uint8_t>(change.value.type()));
                wire::putValue(r.bytes, change.value);
                break;
            }
        }
    }
};

ChangeEncoder::ChangeEncoder(const StreamMode& mode, TypeTable types) : parts_(std::make_unique<Parts>(mode, types)) {}
ChangeEncoder::~ChangeEncoder() = default;

void ChangeEncoder::makeSmall() {
    parts_->makesSmall = true;
}

void ChangeEncoder::restart() {
    parts_->described.assign(parts_->types.size(), false);
    parts_->forget = true;
}

void ChangeEncoder::encode(const ChangeSet& set, ByteBuffer& record) {
    Parts& parts = *parts_;
    std::uint8_t flags = 0;
    if (set.isSnapshot()) {
        restart();
    } else if (parts.mode.coding != Coding::raw && set.changes.size() > kMaxPredicted) {
        restart();
    } else if (parts.mode.coding != Coding::raw) {
        flags = kRemember;
        const std::size_t maximum = std::max(kMaxRemembered, 2 * parts.predicted);
        if (parts.forget || parts.writer.history().slots() > maximum)
            flags |= kForget | kSync;
        else if (++parts.sinceSync >= kSyncEvery)
            flags |= kSync;
        if (flags & kSync) parts.sinceSync = 0;
        parts.forget = false;
        parts.writer.begin(flags);
    }
    write(set, flags, flags != 0, record);
}

void ChangeEncoder::encodeMerged(const ChangeSet& set, ByteBuffer& record) {
    restart();
    write(set, parts_->mode.coding == Coding::raw || set.isSnapshot() ? 0 : kRemember | kSync, false, record);
}

bool ChangeEncoder::encodeScene(const ChangeSet& snapshot, ByteBuffer& record) {
    if (!parts_->takeNumbersOfCatalogue(snapshot)) return false;
    const bool reduced = std::exchange(parts_->makesSmall, true);
    restart();
    write(snapshot, 0, false, record);
    parts_->makesSmall = reduced;
    parts_->catalogued.clear();
    return true;
}

bool ChangeEncoder::describesTypesOf(const ChangeSet& set) const {
    const std::vector<bool>& described = parts_->described;
    return std::ranges::none_of(set.changes, [&](const Change& change) {
        return change.kind == ChangeKind::createNode && change.index < described.size() && !described[change.index];
    });
}

void ChangeEncoder::write(const ChangeSet& set, std::uint8_t flags, bool predicting, ByteBuffer& record) {
    Parts& parts = *parts_;
    parts.clear();
    parts.predicting = predicting;
    parts.predicted = 0;
    if (set.isSnapshot()) parts.describe(parts.rootType);
    const std::span<const Change> changes(set.changes);
    const bool inPlace = parts.mayBeOneRun(set);
    std::size_t i = inPlace ? parts.writeRun(changes, record) : 0;
    if (inPlace && i == changes.size()) return parts.seal(set, flags, 0, record);
    while (i < changes.size()) {
        if (const std::size_t run = parts.addValuesRun(changes.subspan(i)); run > 0) {
            i += run;
            continue;
        }
        const Change& change = changes[i++];
        if (change.kind == ChangeKind::setField && sf(change.value.type()) != FieldType::SFNode)
            parts.addValue(change);
        else
            parts.add(set, change);
    }
    if (set.authors) parts.addAuthors(*set.authors);

    record.clear();
    record.room(parts.maxBytes());
    record.advance(kRecordHeaderSize);
    const bool isScene = !parts.catalogued.empty();
    if (isScene) {
        record.put(wire::kSceneVersion);
        record.put(static_cast<std::uint16_t>(wire::catalogueSize()));
        record.put(parts.catalogued[parts.rootType]);
    }
    const std::uint64_t inflated = parts.makesSmall ? parts.putSmall(record) : parts.put(record);
    parts.seal(set, flags, inflated, record);
    if (set.isSnapshot()) parts.release();
}

}  // namespace rtsg
