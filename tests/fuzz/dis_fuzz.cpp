// Datagrams of any kind, to the PDU codec and to a scene that listens: no crash, no hang, nothing that is not finite in
// a place, what was read is written and read as the same, and a replica of the scene's inputs stays its equal.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/core/dis_pdu.h>
#include <rtsg/core/x3d.h>
#include <rtsg/dis/dis_network.h>
#include <rtsg/documents/loader.h>

#include "sync/codec/input_wire.h"

namespace {

using namespace rtsg;

void expect(bool condition) {
    if (!condition) std::abort();
}

constexpr const char* kScene = R"(#X3D V4.0 utf8
PROFILE Full
DEF E EspduTransform { networkMode "networkReader" address "a" port 1 siteID 1 applicationID 2 entityID 3 }
DEF R ReceiverPdu { networkMode "networkReader" address "a" port 1 siteID 1 applicationID 2 entityID 3 radioID 4 }
DEF S SignalPdu { networkMode "networkReader" address "a" port 1 siteID 1 applicationID 2 entityID 3 radioID 4 }
DEF T TransmitterPdu { networkMode "networkReader" address "a" port 1 siteID 1 applicationID 2 entityID 3 radioID 4 }
DEF M DISEntityManager { address "a" port 1 children DISEntityTypeMapping { kind 1 url "x.x3d" } }
DEF G Group { } ROUTE M.addedEntities TO G.addChildren ROUTE M.removedEntities TO G.removeChildren
)";

/// The input, cut into datagrams: two bytes of length, then as many.
class Cut final : public DisTransport {
  public:
    explicit Cut(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
    Result<> listen(const DisAddress&, const DisAddress&) override { return {}; }
    void stopListening(const DisAddress&) override {}
    std::size_t receive(const DisAddress&, std::size_t,
                        const std::function<void(std::span<const std::uint8_t>)>& take) override {
        if (bytes_.size() < 2) return 0;
        const std::size_t length = std::min(bytes_.size() - 2, std::size_t{bytes_[0]} << 8 | bytes_[1]);
        take(bytes_.subspan(2, length));
        bytes_ = bytes_.subspan(2 + length);
        return 1;
    }
    Result<> send(const DisAddress&, const DisAddress&, std::span<const std::uint8_t>) override { return {}; }
    bool isEmpty() const { return bytes_.size() < 2; }

  private:
    std::span<const std::uint8_t> bytes_;
};

struct Follower final : Subscriber {
    explicit Follower(Scene& copy) : wire(copy) {}
    Result<> apply(const Scene&, const ChangeSet& set) override {
        expect(wire.take(set).empty());
        return {};
    }
    test::InputWire wire;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (const auto pdu = dis::decode({data, size})) {
        const auto again = dis::decode(dis::encode(*pdu));
        expect(again && *again == *pdu);
    }
    Scene scene, copy;
    Diagnostics diagnostics;
    expect(loadText(scene, kScene, diagnostics));
    scene.setInputRecording(true);
    Follower follower(copy);
    const Attachment attachment = scene.bus().attach(follower);
    auto transport = std::make_unique<Cut>(std::span(data, std::min<std::size_t>(size, 1 << 14)));
    const Cut& rest = *transport;
    DisNetwork network(scene, {.allowed = {"any"}}, std::move(transport));
    (void)scene.newFrame(0);
    network.send();
    for (int k = 1; k < 64 && !rest.isEmpty(); ++k) {
        network.receive(k);
        (void)scene.newFrame(k);
        network.send();
        const Vec3f at = scene.node(scene.findName("E")).get(x3d::EspduTransform::translation);
        expect(!std::isnan(at.x) && !std::isnan(at.y) && !std::isnan(at.z));
    }
    return 0;
}
