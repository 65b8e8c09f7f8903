// The nodes of a scene on a network that is in memory.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include <gtest/gtest.h>

#include <rtsg/core/dis_input.h>
#include <rtsg/core/dis_pdu.h>
#include <rtsg/core/x3d.h>
#include <rtsg/dis/dis_network.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_builder.h>

#include "sync/codec/input_wire.h"

namespace rtsg {

namespace {

using Espdu = x3d::EspduTransform;

/// A network in memory: what is sent to an address comes to all who listen there.
struct Ether {
    std::map<DisAddress, std::vector<std::vector<std::uint8_t>>> sent;
    std::vector<DisAddress> listened;
};
class EtherTransport final : public DisTransport {
  public:
    explicit EtherTransport(Ether& ether) : ether_(ether) {}
    Result<> listen(const DisAddress& address, const DisAddress&) override {
        ether_.listened.push_back(address);
        at_[address] = ether_.sent[address].size();
        return {};
    }
    void stopListening(const DisAddress& address) override {
        std::erase(ether_.listened, address);
        at_.erase(address);
    }
    std::size_t receive(const DisAddress& address, std::size_t maximum,
                        const std::function<void(std::span<const std::uint8_t>)>& take) override {
        const auto all = ether_.sent[address];
        std::size_t count = 0;
        for (std::size_t& next = at_[address]; next < all.size() && count < maximum; ++count) take(all[next++]);
        return count;
    }
    Result<> send(const DisAddress& address, const DisAddress&, std::span<const std::uint8_t> bytes) override {
        ether_.sent[address].emplace_back(bytes.begin(), bytes.end());
        return {};
    }

  private:
    Ether& ether_;
    std::map<DisAddress, std::size_t> at_;
};

/// A scene with a network of its own.
struct Host {
    explicit Host(const std::string& text, Ether& ether, std::vector<std::string> allowed = {"any"})
        : network(scene, {.allowed = std::move(allowed), .wallClock = [this] { return wall; }},
                  std::make_unique<EtherTransport>(ether)) {
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u) << (diagnostics.all().empty() ? "" : diagnostics.all()[0].format());
    }
    std::shared_ptr<const ChangeSet> frame(double t) {
        wall = t;
        network.receive(t);
        auto set = scene.newFrame(t);
        network.send();
        return set;
    }
    const Node& node(std::string_view name) { return scene.node(scene.findName(name)); }
    std::string said() {
        std::string text;
        for (const Diagnostic& d : scene.diagnostics().all()) text += d.format() + '\n';
        return text;
    }

    Scene scene;
    Diagnostics diagnostics;
    double wall = 0;
    DisNetwork network;
};

const DisAddress kGroup{"239.1.2.3", 3000};

std::string entity(const std::string& name, const std::string& mode, const std::string& rest = {}) {
    return "DEF " + name + " EspduTransform { networkMode \"" + mode +
           "\" address \"239.1.2.3\" port 3000 siteID 1 applicationID 2 entityID 3 " + rest + " }\n";
}

void put(Ether& ether, const dis::Pdu& pdu, const DisAddress& to = kGroup) {
    ether.sent[to].push_back(dis::encode(pdu));
}

dis::EntityState stateOf(std::uint16_t number) {
    dis::EntityState state;
    state.id = {1, 2, number};
    return state;
}

dis::Header datedAt(double seconds, bool isAbsolute) {
    dis::Header header;
    header.timestamp = dis::timestampOf(seconds, isAbsolute);
    return header;
}

/// The PDUs of one kind that were sent.
template <class Body>
std::vector<dis::Pdu> sentOf(const Ether& ether, const DisAddress& to = kGroup) {
    std::vector<dis::Pdu> found;
    const auto at = ether.sent.find(to);
    if (at == ether.sent.end()) return found;
    for (const auto& bytes : at->second)
        if (auto pdu = dis::decode(std::span(bytes).subspan(dis::rtpHeaderLength(bytes).value())))
            if (std::holds_alternative<Body>(pdu->body)) found.push_back(*pdu);
    return found;
}

}  // namespace

TEST(DisNetwork, AWriterIsReadElsewhere) {
    Ether ether;
    Host writer(
        entity("E", "networkWriter",
               "translation 10 5 -3 rotation 0 1 0 1 linearVelocity 2 0 0 deadReckoning 2 marking \"TANK\" forceID 2 "
               "entityKind 1 entityDomain 1 entityCountry 225 entityCategory 4"),
        ether);
    Host reader(entity("E", "networkReader"), ether);
    reader.frame(0);
    writer.frame(0);
    reader.frame(.1);
    const Node& e = reader.node("E");
    EXPECT_NEAR(glm::length(e.get(Espdu::translation) - Vec3f(10.2f, 5, -3)), 0, 1e-5);
    EXPECT_NEAR(e.get(Espdu::rotation).angle, 1, 1e-5);
    EXPECT_NEAR(e.get(Espdu::rotation).y, 1, 1e-5);
    EXPECT_EQ(e.get(Espdu::linearVelocity), Vec3f(2, 0, 0));
    EXPECT_EQ(e.get(Espdu::marking).view(), "TANK");
    EXPECT_EQ(e.get(Espdu::forceID), 2);
    EXPECT_EQ(e.get(Espdu::entityCountry), 225);
    EXPECT_EQ(e.get(Espdu::entityCategory), 4);
    EXPECT_TRUE(e.get(Espdu::isActive));
    EXPECT_TRUE(e.get(Espdu::isNetworkReader));
    EXPECT_NEAR(e.get(Espdu::timestamp).seconds, 0, 1e-5);
    // Between two PDUs it goes on by itself.
    reader.frame(.6);
    EXPECT_NEAR(reader.node("E").get(Espdu::translation).x, 11.2, 1e-5);
    EXPECT_EQ(writer.said() + reader.said(), "");
}

TEST(DisNetwork, NothingIsOpenedThatIsNotAllowed) {
    Ether ether;
    const std::string scene = entity("R", "networkReader") + entity("W", "networkWriter") +
                              "DISEntityManager { address \"239.1.2.3\" port 3000 }";
    using Lists = std::vector<std::vector<std::string>>;
    for (const auto& allowed : Lists{{}, {"localhost"}, {"239.1.2.3:3001"}, {"239.1.2.30"}, {"239.1.2"}}) {
        Host host(scene, ether, allowed);
        for (int k = 0; k < 5; ++k) host.frame(k);
        EXPECT_TRUE(ether.listened.empty());
        EXPECT_TRUE(ether.sent.empty());
        EXPECT_EQ(host.network.counts().addresses, 0u);
        const std::string said = host.said();
        EXPECT_NE(said.find("EspduTransform R: no network is used for 239.1.2.3:3000: --dis 239.1.2.3:3000 allows it"),
                  std::string::npos)
            << said;
        EXPECT_EQ(std::ranges::count(said, '\n'), 3) << said;  // each node once
        EXPECT_TRUE(host.node("R").get(Espdu::isNetworkReader));
    }
    for (const auto& allowed : Lists{{"239.1.2.3"}, {"239.1.2.3:3000"}, {"any"}}) {
        Host host(scene, ether, allowed);
        host.frame(0);
        EXPECT_EQ(ether.listened, std::vector{kGroup});
        EXPECT_FALSE(ether.sent[kGroup].empty());
        EXPECT_EQ(host.said(), "");
        ether = {};
    }
}

/// A port of its own follows the last colon behind any bracket.
TEST(DisNetwork, AnAddressWithColonsIsAllowedInBrackets) {
    const std::string scene = "DISEntityManager { address \"ff02::1:3\" port 3000 }";
    for (const auto& [allowed, opens] : {std::pair{"ff02::1:3", true},
                                         {"[ff02::1:3]:3000", true},
                                         {"[ff02::1:3]:3001", false},
                                         {"[ff02::1:3]", false},
                                         {"ff02::1", false}}) {
        Ether ether;
        Host host(scene, ether, {allowed});
        host.frame(0);
        EXPECT_EQ(ether.listened.size(), opens ? 1u : 0u) << allowed << '\n' << host.said();
    }
}

TEST(DisNetwork, StandAloneNodesAndDisabledOnesOpenNothing) {
    Ether ether;
    Host host(entity("A", "standAlone") + entity("B", "networkReader", "enabled FALSE") +
                  entity("C", "networkWriter", "enabled FALSE") + "EspduTransform { }",
              ether);
    host.frame(0);
    EXPECT_TRUE(ether.listened.empty());
    EXPECT_TRUE(ether.sent.empty());
    EXPECT_EQ(host.said(), "");
    EXPECT_TRUE(host.node("A").get(Espdu::isStandAlone));
    // Modes may change at any time.
    ASSERT_TRUE(
        host.scene.sendEvent(host.scene.findName("A"), Espdu::networkMode.index, Value(String("networkReader"))));
    host.frame(1);
    host.frame(2);
    EXPECT_EQ(ether.listened, std::vector{kGroup});
    ASSERT_TRUE(host.scene.sendEvent(host.scene.findName("A"), Espdu::networkMode.index, Value(String("standAlone"))));
    host.frame(3);
    host.frame(4);
    EXPECT_TRUE(ether.listened.empty());
}

TEST(DisNetwork, IntervalsAndHeartbeats) {
    Ether ether;
    Host host(entity("E", "networkWriter", "writeInterval .5"), ether);
    for (int k = 0; k <= 100; ++k) host.frame(k / 20.);
    EXPECT_EQ(sentOf<dis::EntityState>(ether).size(), 11u);
    ether = {};
    Host slow(entity("E", "networkWriter", "writeInterval 60"), ether);
    for (int k = 0; k <= 50; ++k) slow.frame(k / 5.);
    EXPECT_EQ(sentOf<dis::EntityState>(ether).size(), 3u);  // at 0, 5 and 10 s
    ether = {};
    Host mute(entity("E", "networkWriter", "writeInterval 0"), ether);
    for (int k = 0; k <= 20; ++k) mute.frame(k);
    EXPECT_TRUE(ether.sent.empty());
    // A reader that reads each second takes the last state that came, and everything that happened.
    Host reader(entity("E", "networkReader", "readInterval 1"), ether);
    std::vector<double> heard;
    reader.scene.setEventListener([&](double t, const Node&, FieldIndex field, const Value&) {
        if (field == Espdu::timestamp.index) heard.push_back(t);
    });
    for (int k = 0; k <= 40; ++k) {
        auto state = stateOf(3);
        state.location = {k * 1., 0, 0};
        put(ether, {{}, state});
        reader.frame(k / 10.);
    }
    EXPECT_EQ(heard, (std::vector{.1, 1.1, 2.1, 3.1}));
    EXPECT_EQ(reader.node("E").get(Espdu::translation).x, 31);
    Host deaf(entity("E", "networkReader", "readInterval 0"), ether);
    put(ether, {{}, stateOf(3)});
    deaf.frame(0);
    deaf.frame(1);
    EXPECT_FALSE(deaf.node("E").get(Espdu::isActive));
}

TEST(DisNetwork, SilenceEndsActivityAndMotion) {
    Ether ether;
    Host host(entity("E", "networkReader"), ether);
    host.frame(0);
    auto state = stateOf(3);
    state.deadReckoning = 2;
    state.velocity = {1, 0, 0};
    put(ether, {{}, state});
    host.frame(1);
    EXPECT_TRUE(host.node("E").get(Espdu::isActive));
    host.frame(12.9);
    EXPECT_TRUE(host.node("E").get(Espdu::isActive));
    EXPECT_NEAR(host.node("E").get(Espdu::translation).x, 11.9, 1e-5);
    host.frame(13);
    EXPECT_FALSE(host.node("E").get(Espdu::isActive));
    host.frame(20);
    EXPECT_NEAR(host.node("E").get(Espdu::translation).x, 11.9, 1e-5);
}

TEST(DisNetwork, WhatHappensIsSentOnce) {
    Ether ether;
    Host writer(
        entity(
            "E", "networkWriter",
            "munitionStartPoint 1 2 3 munitionEndPoint 1 2 -97 firingRange 100 warhead 1000 fuse 7 firingRate 2 "
            "munitionQuantity 3 eventNumber 5 eventSiteID 1 eventApplicationID 2 eventEntityID 9 fireMissionIndex 4"),
        ether);
    Host reader(entity("E", "networkReader"), ether);
    writer.frame(0), reader.frame(0);
    const NodeId e = writer.scene.findName("E");
    ASSERT_TRUE(writer.scene.sendEvent(e, Espdu::fired1.index, Value(true)));
    writer.frame(1), writer.frame(1.1), writer.frame(1.2);
    ASSERT_EQ(sentOf<dis::Fire>(ether).size(), 1u);
    reader.frame(1.3);
    const Node& r = reader.node("E");
    EXPECT_EQ(r.get(Espdu::firedTime).seconds, 1.3);
    EXPECT_TRUE(r.get(Espdu::fired1));
    EXPECT_EQ(r.get(Espdu::munitionStartPoint), Vec3f(1, 2, 3));
    EXPECT_NEAR(glm::length(r.get(Espdu::munitionEndPoint) - Vec3f(1, 2, -97)), 0, 1e-5);
    EXPECT_EQ(r.get(Espdu::warhead), 1000);
    EXPECT_EQ(r.get(Espdu::fuse), 7);
    EXPECT_EQ(r.get(Espdu::firingRate), 2);
    EXPECT_EQ(r.get(Espdu::munitionQuantity), 3);
    EXPECT_EQ(r.get(Espdu::eventNumber), 5);
    EXPECT_EQ(r.get(Espdu::fireMissionIndex), 4);
    ASSERT_TRUE(writer.scene.sendEvent(e, Espdu::detonationLocation.index, Value(Vec3f(1, 2, -97))));
    ASSERT_TRUE(writer.scene.sendEvent(e, Espdu::detonationResult.index, Value(5)));
    writer.frame(2), writer.frame(2.1);
    ASSERT_EQ(sentOf<dis::Detonation>(ether).size(), 1u);
    reader.frame(2.2);
    EXPECT_TRUE(reader.node("E").get(Espdu::isDetonated));
    EXPECT_EQ(reader.node("E").get(Espdu::detonateTime).seconds, 2.2);
    EXPECT_EQ(reader.node("E").get(Espdu::detonationLocation), Vec3f(1, 2, -97));
    EXPECT_EQ(reader.node("E").get(Espdu::detonationResult), 5);
    ASSERT_TRUE(writer.scene.sendEvent(e, Espdu::collisionType.index, Value(1)));
    writer.frame(3), writer.frame(3.1);
    ASSERT_EQ(sentOf<dis::Collision>(ether).size(), 1u);
    EXPECT_EQ(std::get<dis::Collision>(sentOf<dis::Collision>(ether)[0].body).colliding, (dis::EntityId{1, 2, 9}));
    reader.frame(3.2);
    EXPECT_TRUE(reader.node("E").get(Espdu::isCollided));
    EXPECT_EQ(reader.node("E").get(Espdu::collideTime).seconds, 3.2);
}

TEST(DisNetwork, ArticulatedPartsGoAcross) {
    Ether ether;
    Host writer(entity("E", "networkWriter", "articulationParameterTypeArray [ 4107, 4429 ]"), ether);
    Host reader(entity("E", "networkReader"), ether);
    writer.frame(0), reader.frame(0);
    ASSERT_TRUE(
        writer.scene.sendEvent(writer.scene.findName("E"), Espdu::set_articulationParameterValue1.index, Value(1.25f)));
    writer.frame(1);
    const auto states = sentOf<dis::EntityState>(ether);
    const auto& parts = std::get<dis::EntityState>(states.back().body).articulations;
    ASSERT_EQ(parts.size(), 2u);
    EXPECT_EQ(parts[1], (dis::Articulation{0, 1, 0, 4429, 1.25f}));
    reader.frame(1.1);
    EXPECT_EQ(reader.node("E").get(Espdu::articulationParameterValue1_changed), 1.25f);
    EXPECT_EQ(reader.node("E").get(Espdu::articulationParameterCount), 2);
    EXPECT_EQ(reader.node("E").get(Espdu::articulationParameterTypeArray)[0], 4107);
    EXPECT_EQ(reader.node("E").get(Espdu::articulationParameterChangeIndicatorArray)[1], 1);
}

TEST(DisNetwork, RadiosGoAcross) {
    Ether ether;
    const auto scene = [](const std::string& mode) {
        const std::string head = "{ networkMode \"" + mode +
                                 "\" address \"239.1.2.3\" port 3000 siteID 1 applicationID 2 "
                                 "entityID 3 radioID 4 ";
        const bool is = mode == "networkWriter";
        return "DEF T TransmitterPdu " + head +
               (is ? "frequency 30000000 power 40 transmitState 2 antennaLocation 1 2 3 relativeAntennaLocation 0 2 0 "
                     "modulationTypeMajor 2 transmitFrequencyBandwidth 25000 cryptoKeyID 9 }"
                   : "}") +
               "DEF S SignalPdu " + head + (is ? "encodingScheme 1 sampleRate 8000 samples 3 }" : "}") +
               "DEF R ReceiverPdu " + head +
               (is ? "receiverState 2 receivedPower -50.5 transmitterSiteID 7 transmitterRadioID 8 }" : "}");
    };
    Host writer(scene("networkWriter"), ether);
    Host reader(scene("networkReader"), ether);
    reader.frame(0), writer.frame(0);
    EXPECT_TRUE(sentOf<dis::Signal>(ether).empty());  // there is no signal yet
    Array<std::int32_t> data;
    for (const int byte : {1, 2, 255}) data.push_back(byte);
    for (const double t : {1., 3.}) {
        ASSERT_TRUE(writer.scene.sendEvent(writer.scene.findName("S"), x3d::SignalPdu::data.index, Value(data)));
        writer.frame(t), writer.frame(t + .5);
        data.push_back(9);
    }
    EXPECT_EQ(sentOf<dis::Signal>(ether).size(), 2u);
    reader.frame(4);
    using T = x3d::TransmitterPdu;
    const Node& t = reader.node("T");
    EXPECT_EQ(t.get(T::frequency), 30000000);
    EXPECT_EQ(t.get(T::power), 40);
    EXPECT_EQ(t.get(T::transmitState), 2);
    EXPECT_EQ(t.get(T::antennaLocation), Vec3f(1, 2, 3));
    EXPECT_EQ(t.get(T::relativeAntennaLocation), Vec3f(0, 2, 0));
    EXPECT_EQ(t.get(T::modulationTypeMajor), 2);
    EXPECT_EQ(t.get(T::transmitFrequencyBandwidth), 25000);
    EXPECT_EQ(t.get(T::cryptoKeyID), 9);
    EXPECT_TRUE(t.get(T::isActive));
    using S = x3d::SignalPdu;
    const Node& s = reader.node("S");
    EXPECT_EQ(s.get(S::data).size(), 4u);
    EXPECT_EQ(s.get(S::data)[2], 255);
    EXPECT_EQ(s.get(S::dataLength), 32);
    EXPECT_EQ(s.get(S::sampleRate), 8000);
    using R = x3d::ReceiverPdu;
    const Node& r = reader.node("R");
    EXPECT_EQ(r.get(R::receivedPower), -50.5f);
    EXPECT_EQ(r.get(R::receiverState), 2);
    EXPECT_EQ(r.get(R::transmitterSiteID), 7);
    EXPECT_EQ(r.get(R::transmitterRadioID), 8);
    // 2.4 heartbeats of 2 s.
    reader.frame(8.7);
    EXPECT_TRUE(reader.node("T").get(T::isActive));
    reader.frame(8.9);
    EXPECT_FALSE(reader.node("T").get(T::isActive));
    EXPECT_TRUE(reader.node("R").get(R::isActive));
}

TEST(DisNetwork, RtpHeadersAreWrittenAndHeard) {
    Ether ether;
    Host writer(entity("E", "networkWriter", "rtpHeaderExpected TRUE"), ether);
    Host reader(entity("E", "networkReader"), ether);
    reader.frame(0), writer.frame(0), reader.frame(1);
    EXPECT_EQ(ether.sent[kGroup].at(0).size(), 156u);
    EXPECT_TRUE(reader.node("E").get(Espdu::isRtpHeaderHeard));
    EXPECT_TRUE(reader.node("E").get(Espdu::isActive));
}

TEST(DisNetwork, DatesOfPdusCount) {
    Ether ether;
    Host host(entity("E", "networkReader"), ether);
    host.frame(7200);
    auto state = stateOf(3);
    state.deadReckoning = 2;
    state.velocity = {1, 0, 0};
    put(ether, {datedAt(7201, true), state});
    host.frame(7203);
    EXPECT_NEAR(host.node("E").get(Espdu::translation).x, 2, 1e-5);  // true 2 s ago
    EXPECT_NEAR(host.node("E").get(Espdu::timestamp).seconds, 7201, 1e-5);
    put(ether, {datedAt(7201, false), state});
    host.frame(7204);
    EXPECT_NEAR(host.node("E").get(Espdu::translation).x, 0, 1e-5);  // of another clock: true when it came
    put(ether, {datedAt(7300, true), state});
    host.frame(7205);
    EXPECT_NEAR(host.node("E").get(Espdu::translation).x, 0, 1e-5);  // of the time to come: clocks differ
    EXPECT_NEAR(host.node("E").get(Espdu::timestamp).seconds, 7300, 1e-5);
}

TEST(DisNetwork, GeocentricPlacesLieAroundGeoCoords) {
    Ether ether;
    Host writer(entity("E", "networkWriter", "geoCoords 48 11 500 translation 100 20 -300 rotation 0 1 0 .5"), ether);
    Host reader(entity("E", "networkReader", "geoCoords 48 11 500"), ether);
    Host away(entity("E", "networkReader", "geoCoords 48.001 11 500"), ether);
    reader.frame(0), away.frame(0), writer.frame(0), reader.frame(.5), away.frame(.5);
    const auto state = std::get<dis::EntityState>(sentOf<dis::EntityState>(ether).at(0).body);
    EXPECT_NEAR(glm::length(state.location), 6366000, 10000);
    EXPECT_NEAR(glm::length(reader.node("E").get(Espdu::translation) - Vec3f(100, 20, -300)), 0, 1e-4);
    EXPECT_NEAR(reader.node("E").get(Espdu::rotation).angle, .5, 1e-5);
    EXPECT_NEAR(away.node("E").get(Espdu::translation).z, -300 + 111.2, .2);  // a thousandth of a degree to the north
}

TEST(DisNetwork, AManagerMakesNodesForEntities) {
    const auto folder = std::filesystem::temp_directory_path() / ("rtsg-dis-" + std::to_string(getpid()));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "tank.x3dv") << "#X3D V4.0 utf8\nPROFILE Full\nDEF Tank Shape { geometry Box { } }\n";
    Ether ether;
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(
        scene,
        "#X3D V4.0 utf8\nPROFILE Full\n"
        "DEF M DISEntityManager { address \"239.1.2.3\" port 3000 children [\n"
        " DISEntityTypeMapping { kind 1 url \"any.x3dv\" }\n"
        " DISEntityTypeMapping { kind 1 domain 1 url \"tank.x3dv\" }\n"
        " DISEntityTypeMapping { kind 1 domain 2 country 3 url \"plane.x3dv\" } ] }\n"
        "DEF G Group { } DEF OWN EspduTransform { networkMode \"networkReader\" address \"239.1.2.3\" port 3000 "
        "siteID 1 applicationID 2 entityID 3 }\n"
        "ROUTE M.addedEntities TO G.addChildren ROUTE M.removedEntities TO G.removeChildren",
        diagnostics, folder));
    DisNetwork network(scene, {.allowed = {"any"}}, std::make_unique<EtherTransport>(ether));
    BuildOptions options;
    options.resources = folder;
    InlineLoader loader(scene, diagnostics, options);
    const auto frame = [&](double t) {
        network.receive(t);
        (void)scene.newFrame(t);
        if (loader.update() > 0) scene.seal();
        network.send();
    };
    frame(0);
    const std::size_t nodes = scene.nodeCount();
    auto tank = stateOf(10);
    tank.type = {1, 1, 225, 1, 0, 0, 0};
    tank.location = {5, 0, 0};
    tank.marking = "T10";
    put(ether, {{}, tank});
    put(ether, {{}, stateOf(3)});  // a node of the scene stands for it
    frame(1);
    const auto& children = [&]() -> const Array<NodeId>& {
        return scene.node(scene.findName("G")).get(x3d::Group::children);
    };
    ASSERT_EQ(children().size(), 1u);
    const NodeId created = children()[0];
    EXPECT_EQ(scene.node(created).get(Espdu::entityID), 10);
    EXPECT_EQ(scene.node(created).get(Espdu::marking).view(), "T10");
    EXPECT_EQ(scene.node(created).get(Espdu::translation), Vec3f(5, 0, 0));
    EXPECT_TRUE(scene.node(created).get(Espdu::isActive));
    const NodeId model = scene.node(created).get(Espdu::children)[0];
    EXPECT_EQ(scene.node(model).get(x3d::Inline::url)[0].view(), "tank.x3dv");
    EXPECT_TRUE(scene.findName("Tank", model));
    EXPECT_EQ(network.counts().entities, 1u);
    // It is heard like any other.
    tank.location = {6, 0, 0};
    put(ether, {{}, tank});
    frame(2);
    EXPECT_EQ(children().size(), 1u);
    EXPECT_EQ(scene.node(created).get(Espdu::translation), Vec3f(6, 0, 0));
    // Told to go.
    put(ether, {{}, dis::RemoveEntity{{9, 9, 9}, {1, 2, 10}, 1}});
    for (const double t : {3., 4., 5., 6., 7.}) frame(t);
    EXPECT_TRUE(children().empty());
    EXPECT_FALSE(scene.find(created));
    EXPECT_EQ(scene.nodeCount(), nodes);  // the model's too
    // Silent for too long; and one that says it is its last PDU.
    auto other = stateOf(11);
    put(ether, {{}, tank}), put(ether, {{}, other});
    frame(8);
    EXPECT_EQ(children().size(), 2u);
    other.appearance = dis::EntityState::kDeactivated;
    put(ether, {{}, other});
    frame(9);
    EXPECT_EQ(children().size(), 1u);
    put(ether, {{}, other});
    frame(19);
    EXPECT_EQ(children().size(), 1u);
    frame(21), frame(22), frame(23), frame(24), frame(25), frame(26);
    EXPECT_TRUE(children().empty());
    EXPECT_EQ(scene.nodeCount(), nodes);
    EXPECT_EQ(diagnostics.errors(), 0u);
    std::filesystem::remove_all(folder);
}

TEST(DisNetwork, AMappingsUrlObeysThePolicy) {
    Ether ether;
    Host host(
        "DEF M DISEntityManager { address \"239.1.2.3\" port 3000 children DISEntityTypeMapping { url \"/etc/passwd\" "
        "} } "
        "DEF G Group { } ROUTE M.addedEntities TO G.addChildren",
        ether);
    Diagnostics diagnostics;
    InlineLoader loader(host.scene, diagnostics, {});
    host.frame(0);
    put(ether, {{}, stateOf(10)});
    host.frame(1);
    loader.update();
    EXPECT_EQ(diagnostics.errors(), 1u);
}

TEST(DisNetwork, HostileDatagramsAreToldOnceAndLeftOut) {
    Ether ether;
    Host host(entity("E", "networkReader") + "DISEntityManager { address \"239.1.2.3\" port 3000 }", ether);
    host.frame(0);
    auto& sent = ether.sent[kGroup];
    auto good = dis::encode({{}, stateOf(3)});
    for (int k = 0; k < 100; ++k) {
        sent.emplace_back();
        sent.emplace_back(5, 0x07);
        sent.emplace_back(good.begin(), good.begin() + 100);
        sent.push_back(good);
        sent.back()[19] = 255;  // parts that are not there
        sent.push_back(good);
        sent.back()[48] = 0x7f, sent.back()[49] = 0xf8;  // a place that is no number
        sent.push_back(std::vector<std::uint8_t>(9000, 0xff));
        sent.push_back(good);
        sent.back()[8] = sent.back()[9] = 0;  // a length that would never end
    }
    host.frame(1);
    EXPECT_FALSE(host.node("E").get(Espdu::isActive));
    EXPECT_EQ(host.network.counts().unreadable, 600u);
    const std::string said = host.said();
    EXPECT_LE(std::ranges::count(said, '\n'), 6) << said;
    EXPECT_NE(
        said.find("a PDU to 239.1.2.3:3000 of type 1 has a number that is not finite or beyond 1e30: it is left out"),
        std::string::npos)
        << said;
    // A flood: so many entities, so many datagrams a frame, and no more.
    for (int k = 0; k < 10'000; ++k) {
        auto state = stateOf(static_cast<std::uint16_t>(k));
        state.id.site = 99;
        put(ether, {{}, state});
    }
    for (int k = 0; k < 4; ++k) host.frame(2 + k);
    EXPECT_EQ(host.network.counts().entities, DisNetwork::kMaxEntities);
    EXPECT_NE(host.said().find("more than 4096 entities"), std::string::npos);
}

TEST(DisNetwork, NoiseIsToldOfAFewTimesAndHidesNoOtherWarning) {
    Ether ether;
    Host host(entity("E", "networkReader"), ether);
    host.frame(0);
    auto& sent = ether.sent[kGroup];
    for (int length = 0; length < 100; ++length)
        for (int version = 8; version < 40; ++version) {
            auto noise = dis::encode({{}, stateOf(3)});
            noise[0] = static_cast<std::uint8_t>(version);
            noise.resize(static_cast<std::size_t>(12 + length));
            sent.push_back(noise);
        }
    for (int k = 0; k < 40; ++k) host.frame(1 + k);
    EXPECT_EQ(host.network.counts().unreadable, 3200u);
    std::string said = host.said();
    EXPECT_EQ(std::ranges::count(said, '\n'), 8) << said;
    EXPECT_NE(said.find("is of version 15, 5 to 7 are known: it is left out, and more like it is not told"),
              std::string::npos)
        << said;
}

TEST(DisNetwork, SeveralPdusInADatagramAreAllRead) {
    Ether ether;
    Host host(entity("E", "networkReader"), ether);
    host.frame(0);
    dis::Collision collision;
    collision.issuing = {5, 5, 5}, collision.colliding = {1, 2, 3};
    auto both = dis::encode({{}, collision});
    auto unknown = dis::encode({{}, stateOf(3)});
    unknown[2] = 72;  // of a type that nobody here knows
    const auto state = dis::encode({{}, stateOf(3)});
    both.insert(both.end(), unknown.begin(), unknown.end());
    both.insert(both.end(), state.begin(), state.end());
    ether.sent[kGroup].push_back(both);
    host.frame(1);
    EXPECT_TRUE(host.node("E").get(Espdu::isActive));
    EXPECT_TRUE(host.node("E").get(Espdu::isCollided));
    EXPECT_EQ(host.said(), "");
}

TEST(DisNetwork, FollowersAndReplaysNeedNoNetwork) {
    Ether ether;
    Host origin(entity("E", "networkReader"), ether);
    origin.scene.setInputRecording(true);
    Scene mirror, computed;
    mirror.setBehavioursEnabled(false);
    struct Follow final : Subscriber {
        Follow(Scene& to, Scene& copy) : mirror(to), wire(copy) {}
        Result<> apply(const Scene&, const ChangeSet& set) override {
            EXPECT_TRUE(mirror.apply(std::make_shared<ChangeSet>(set)));
            EXPECT_EQ(wire.take(set), "");
            return {};
        }
        Scene& mirror;
        test::InputWire wire;
    } follow(mirror, computed);
    const Attachment attachment = origin.scene.bus().attach(follow);
    auto state = stateOf(3);
    state.deadReckoning = 8;
    state.velocity = {10, 1, 0};
    state.acceleration = {0, 0, 1};
    state.angularVelocity = {.1f, .2f, .3f};
    for (int k = 0; k < 50; ++k) {
        if (k % 10 == 3) put(ether, {{}, state});
        (void)origin.frame(k / 10.);
        ASSERT_EQ(mirror.hash(), origin.scene.hash()) << k;
        ASSERT_EQ(computed.hash(), origin.scene.hash()) << k;
    }
    EXPECT_NE(origin.node("E").get(Espdu::translation), Vec3f(0));
    EXPECT_GT(follow.wire.inputFrames, 40u);
}

}  // namespace rtsg
