// The bytes of DIS PDUs: one list of fields for each, which the reader and the writer both go through.
#include <rtsg/core/dis_pdu.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include <rtsg/core/check.h>

namespace rtsg::dis {

namespace {

constexpr std::size_t kHeaderLength = 12, kMarkingLength = 11, kArticulationLength = 16;
constexpr double kMaxNumber = 1e30;  // fields of a scene are floats

/// Takes numbers off a PDU whose end is known. After the first that is not there all others are 0.
class PduReader {
  public:
    static constexpr bool kReads = true;
    explicit PduReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

    template <class T>
    void number(T& value) {
        std::uint8_t raw[sizeof(T)] = {};
        if (bytes_.size() - at_ < sizeof(T))
            isShort_ = true, at_ = bytes_.size();
        else
            std::memcpy(raw, bytes_.data() + at_, sizeof(T)), at_ += sizeof(T);
        std::ranges::reverse(raw);
        value = std::bit_cast<T>(raw);
        if constexpr (std::is_floating_point_v<T>) isSound_ = isSound_ && std::abs(value) <= T(kMaxNumber);
    }
    void skip(std::size_t count) {
        if (bytes_.size() - at_ < count) isShort_ = true;
        at_ = std::min(bytes_.size(), at_ + count);
    }
    void bytes(std::vector<std::uint8_t>& value, std::size_t count) {
        if (bytes_.size() - at_ < count) return skip(count);
        value.assign(bytes_.begin() + std::ptrdiff_t(at_), bytes_.begin() + std::ptrdiff_t(at_ + count));
        at_ += count;
    }
    std::size_t left() const { return bytes_.size() - at_; }
    bool isShort() const { return isShort_; }
    /// No number is beyond kMaxNumber, or none at all.
    bool isSound() const { return isSound_; }

  private:
    std::span<const std::uint8_t> bytes_;
    std::size_t at_ = 0;
    bool isShort_ = false, isSound_ = true;
};

class PduWriter {
  public:
    static constexpr bool kReads = false;
    template <class T>
    void number(const T& value) {
        auto raw = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
        std::ranges::reverse(raw);
        out.insert(out.end(), raw.begin(), raw.end());
    }
    void skip(std::size_t count) { out.insert(out.end(), count, 0); }
    void bytes(const std::vector<std::uint8_t>& value, std::size_t count) {
        RTSG_CHECK_EQ(value.size(), count);
        out.insert(out.end(), value.begin(), value.end());
    }
    std::vector<std::uint8_t> out;
};

template <class Stream, class... T>
void pass(Stream& s, T&... values) {
    (s.number(values), ...);
}
template <class Stream>
void passPoint(Stream& s, auto& point) {
    pass(s, point.x, point.y, point.z);
}
template <class Stream>
void passId(Stream& s, auto& id) {
    pass(s, id.site, id.application, id.entity);
}
template <class Stream>
void passEvent(Stream& s, auto& event) {
    pass(s, event.site, event.application, event.number);
}
template <class Stream>
void passType(Stream& s, auto& type) {
    pass(s, type.kind, type.domain, type.country, type.category, type.subcategory, type.specific, type.extra);
}
template <class Stream>
void passDescriptor(Stream& s, auto& descriptor) {
    passType(s, descriptor.type);
    pass(s, descriptor.warhead, descriptor.fuse, descriptor.quantity, descriptor.rate);
}

/// 6.2.94: the value of an articulated part is a float and padding. Other kinds of records have no number there.
void passArticulation(PduReader& s, Articulation& part) {
    pass(s, part.designator, part.change, part.attachedTo, part.type);
    if (part.designator != 0) return s.skip(8);
    s.number(part.value);
    s.skip(4);
}
void passArticulation(PduWriter& s, const Articulation& part) {
    pass(s, part.designator, part.change, part.attachedTo, part.type, part.value);
    s.skip(4);
}
void passArticulations(PduReader& s, std::vector<Articulation>& parts, std::uint8_t count) {
    if (s.left() < count * kArticulationLength) return s.skip(count * kArticulationLength);
    parts.resize(count);
    for (Articulation& part : parts) passArticulation(s, part);
}
void passArticulations(PduWriter& s, const std::vector<Articulation>& parts, std::uint8_t count) {
    RTSG_CHECK_EQ(parts.size(), std::size_t{count});
    for (const Articulation& part : parts) passArticulation(s, part);
}

void passMarking(PduReader& s, std::string& marking) {
    std::vector<std::uint8_t> raw;
    s.bytes(raw, kMarkingLength);
    marking.assign(raw.begin(), std::ranges::find(raw, 0));
}
void passMarking(PduWriter& s, const std::string& marking) {
    RTSG_CHECK_LE(marking.size(), kMarkingLength);
    for (const char c : marking) s.number(static_cast<std::uint8_t>(c));
    s.skip(kMarkingLength - marking.size());
}

template <class Stream>
void passBody(Stream& s, auto& e, std::type_identity<EntityState>) {
    passId(s, e.id);
    auto count = static_cast<std::uint8_t>(e.articulations.size());
    pass(s, e.force, count);
    passType(s, e.type);
    passType(s, e.alternativeType);
    passPoint(s, e.velocity);
    passPoint(s, e.location);
    pass(s, e.orientation.psi, e.orientation.theta, e.orientation.phi, e.appearance, e.deadReckoning);
    for (auto& parameter : e.deadReckoningParameters) s.number(parameter);
    passPoint(s, e.acceleration);
    passPoint(s, e.angularVelocity);
    s.number(e.markingCharacters);
    passMarking(s, e.marking);
    s.number(e.capabilities);
    passArticulations(s, e.articulations, count);
}
template <class Stream>
void passBody(Stream& s, auto& f, std::type_identity<Fire>) {
    passId(s, f.firing), passId(s, f.target), passId(s, f.munition);
    passEvent(s, f.event);
    s.number(f.mission);
    passPoint(s, f.location);
    passDescriptor(s, f.descriptor);
    passPoint(s, f.velocity);
    s.number(f.range);
}
template <class Stream>
void passBody(Stream& s, auto& d, std::type_identity<Detonation>) {
    passId(s, d.firing), passId(s, d.target), passId(s, d.munition);
    passEvent(s, d.event);
    passPoint(s, d.velocity);
    passPoint(s, d.location);
    passDescriptor(s, d.descriptor);
    passPoint(s, d.relativeLocation);
    auto count = static_cast<std::uint8_t>(d.articulations.size());
    pass(s, d.result, count);
    s.skip(2);
    passArticulations(s, d.articulations, count);
}
template <class Stream>
void passBody(Stream& s, auto& c, std::type_identity<Collision>) {
    passId(s, c.issuing), passId(s, c.colliding);
    passEvent(s, c.event);
    s.number(c.type);
    s.skip(1);
    passPoint(s, c.velocity);
    s.number(c.mass);
    passPoint(s, c.location);
}
template <class Stream, class Body>
    requires(std::is_same_v<Body, CreateEntity> || std::is_same_v<Body, RemoveEntity>)
void passBody(Stream& s, auto& request, std::type_identity<Body>) {
    passId(s, request.originator), passId(s, request.receiver);
    s.number(request.request);
}
template <class Stream>
void passBody(Stream& s, auto& t, std::type_identity<Transmitter>) {
    passId(s, t.id);
    pass(s, t.radio, t.kind, t.domain, t.country, t.category, t.nomenclatureVersion, t.nomenclature, t.state,
         t.inputSource);
    s.skip(2);
    passPoint(s, t.antennaLocation);
    passPoint(s, t.relativeAntennaLocation);
    auto pattern = static_cast<std::uint16_t>(t.antennaPattern.size());
    auto modulation = static_cast<std::uint8_t>(t.modulationParameters.size());
    pass(s, t.antennaPatternType, pattern, t.frequency, t.bandwidth, t.power, t.spreadSpectrum, t.majorModulation,
         t.detail, t.system, t.cryptoSystem, t.cryptoKey, modulation);
    s.skip(3);
    s.bytes(t.modulationParameters, modulation);
    s.bytes(t.antennaPattern, pattern);
}
template <class Stream>
void passBody(Stream& s, auto& signal, std::type_identity<Signal>) {
    passId(s, signal.id);
    pass(s, signal.radio, signal.encoding, signal.tdlType, signal.sampleRate, signal.bits, signal.samples);
    const std::size_t count = (std::size_t{signal.bits} + 7) / 8;
    s.bytes(signal.data, count);
    if constexpr (!Stream::kReads) s.skip((4 - count % 4) % 4);
}
template <class Stream>
void passBody(Stream& s, auto& r, std::type_identity<Receiver>) {
    passId(s, r.id);
    pass(s, r.radio, r.state);
    s.skip(2);
    s.number(r.power);
    passId(s, r.transmitter);
    s.number(r.transmitterRadio);
}

struct Kind {
    PduType type;
    std::uint8_t family;
    std::size_t index;  // in Pdu::body
};
constexpr Kind kKinds[] = {
    {PduType::entityState, 1, 0},      {PduType::fire, 2, 1},         {PduType::detonation, 2, 2},
    {PduType::collision, 1, 3},        {PduType::createEntity, 5, 4}, {PduType::removeEntity, 5, 5},
    {PduType::transmitter, 4, 6},      {PduType::signal, 4, 7},       {PduType::receiver, 4, 8},
    {PduType::collisionElastic, 1, 3},
};

template <std::size_t... Index>
bool readBody(PduReader& reader, Pdu& pdu, std::size_t index, std::index_sequence<Index...>) {
    return ((index == Index && (passBody(reader, pdu.body.emplace<Index>(),
                                         std::type_identity<std::variant_alternative_t<Index, decltype(pdu.body)>>{}),
                                true)) ||
            ...);
}

}  // namespace

double secondsOf(std::uint32_t timestamp) {
    return double(timestamp >> 1) * 3600 / 2147483648.0;
}

std::uint32_t timestampOf(double secondsSince1970, bool isAbsolute) {
    const double ofHour = secondsSince1970 - 3600 * std::floor(secondsSince1970 / 3600);
    // A time that rounds up to the full hour is the hour's beginning.
    const auto units = static_cast<std::uint64_t>(std::max(0.0, ofHour * 2147483648.0 / 3600)) & 0x7fffffff;
    return static_cast<std::uint32_t>(units << 1) | (isAbsolute ? 1u : 0u);
}

bool isKnown(PduType type) {
    return std::ranges::find(kKinds, type, &Kind::type) != std::end(kKinds);
}

Result<Outline> outlineOf(std::span<const std::uint8_t> bytes) {
    if (bytes.size() < kHeaderLength) return fail(fmt::format("has {} bytes, a header has 12", bytes.size()));
    if (bytes[0] < 5 || bytes[0] > 7) return fail(fmt::format("is of version {}, 5 to 7 are known", bytes[0]));
    const std::size_t length = std::size_t{bytes[8]} << 8 | bytes[9];
    if (length < kHeaderLength || length > bytes.size())
        return fail(fmt::format("says it has {} bytes, {} are there", length, bytes.size()));
    return Outline{PduType{bytes[2]}, length};
}

Result<Pdu> decode(std::span<const std::uint8_t> bytes) {
    const auto outline = outlineOf(bytes);
    if (!outline) return std::unexpected(outline.error());
    const auto* kind = std::ranges::find(kKinds, outline->type, &Kind::type);
    if (kind == std::end(kKinds)) return fail(fmt::format("is of type {}", bytes[2]));
    Pdu pdu;
    PduReader reader(bytes.first(outline->length));
    std::uint8_t type = 0, family = 0;
    std::uint16_t length = 0;
    pass(reader, pdu.header.version, pdu.header.exercise, type, family, pdu.header.timestamp, length,
         pdu.header.status);
    reader.skip(1);
    if (pdu.header.version < 7) pdu.header.status = 0;  // padding there
    readBody(reader, pdu, kind->index, std::make_index_sequence<std::variant_size_v<decltype(pdu.body)>>{});
    if (reader.isShort()) return fail(fmt::format("of type {} ends too early, after {} bytes", type, outline->length));
    if (!reader.isSound()) return fail(fmt::format("of type {} has a number that is not finite or beyond 1e30", type));
    // The elastic kind has padding where the other has its type.
    if (outline->type == PduType::collisionElastic) std::get<Collision>(pdu.body).type = 1;
    return pdu;
}

std::vector<std::uint8_t> encode(const Pdu& pdu) {
    const auto* kind = std::ranges::find(kKinds, pdu.body.index(), &Kind::index);
    PduWriter writer;
    const auto type = static_cast<std::uint8_t>(kind->type);
    const std::uint8_t status = pdu.header.version >= 7 ? pdu.header.status : 0;
    pass(writer, pdu.header.version, pdu.header.exercise, type, kind->family, pdu.header.timestamp);
    writer.skip(2);
    writer.number(status);
    writer.skip(1);
    std::visit([&]<class Body>(const Body& body) { passBody(writer, body, std::type_identity<Body>{}); }, pdu.body);
    RTSG_CHECK_LE(writer.out.size(), std::size_t{65'535});
    writer.out[8] = static_cast<std::uint8_t>(writer.out.size() >> 8);
    writer.out[9] = static_cast<std::uint8_t>(writer.out.size());
    return std::move(writer.out);
}

Result<std::size_t> rtpHeaderLength(std::span<const std::uint8_t> datagram) {
    if (datagram.empty() || datagram[0] >> 6 != 2) return 0;
    std::size_t length = 12 + 4 * std::size_t{datagram[0] & 0xfu};
    if ((datagram[0] & 0x10) && datagram.size() >= length + 4)
        length += 4 + 4 * (std::size_t{datagram[length + 2]} << 8 | datagram[length + 3]);
    if (length >= datagram.size()) return fail("ends within the header of RTP");
    return length;
}

std::array<std::uint8_t, 12> rtpHeader(std::uint16_t sequence, std::uint32_t timestamp, std::uint32_t source) {
    constexpr std::uint8_t kVersion = 0x80, kPayload = 111;  // dynamic, as other DIS programs have it
    PduWriter writer;
    pass(writer, kVersion, kPayload, sequence, timestamp, source);
    std::array<std::uint8_t, 12> header{};
    std::ranges::copy(writer.out, header.begin());
    return header;
}

}  // namespace rtsg::dis
