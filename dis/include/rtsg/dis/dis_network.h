// DisNetwork: lets the DIS nodes of a scene read and write PDUs over UDP, where the user allows it.
//
// A networkReader receives PDUs about its entity, at most once in each readInterval. A networkWriter sends its state
// each writeInterval, and sends fire, collision and detonation events at once. A DISEntityManager makes an
// EspduTransform for each entity that no node of the scene represents, with the model that fits best. PDUs that are
// received are inputs of the frame (rtsg/core/dis_input.h): logs, replays and mirrors need no network, and a mirror
// opens none. No socket is opened for an address that has not been allowed. Memory and time of a frame are limited for
// any datagrams. Threading: the scene's thread; no call waits, except for a name that is looked up once. Source:
// ISO/IEC 19775-1 V4.0, clause 28; IEEE 1278.1-2012 (PDUs, heartbeats), 1278.2-2015 (UDP).

// Example:
//     #include <rtsg/documents/loader.h>
//     #include <rtsg/dis/dis_network.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics;
//     (void)rtsg::loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n EspduTransform { }", diagnostics);
//     rtsg::DisNetwork network(scene, {.allowed = {"localhost:3000"}});
//     for (int k = 0; k < 60; ++k) {
//         network.receive(k / 60.0);
//         scene.newFrame(k / 60.0);
//         network.send();
//     }
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/dis/dis_transport.h>

namespace rtsg {

struct DisOptions {
    /// Addresses that nodes may use: "HOST", "HOST:PORT" or "[IPV6]:PORT", with the host as in their fields; or "any".
    std::vector<std::string> allowed;
    std::uint8_t version = 7, exercise = 1;       // for PDUs that are sent; received ones may be of any exercise
    std::function<double()> wallClock = nullptr;  // seconds since 1970; else the system's
};

class DisNetwork {
  public:
    /// The most datagrams of an address in a frame, PDUs that wait for a node's readInterval, and entities of a
    /// manager. Further ones are left out, and a diagnostic says so.
    static constexpr std::size_t kMaxDatagrams = 4096, kMaxWaiting = 64, kMaxEntities = 4096;
    /// The longest time in seconds between two PDUs of an entity, and the time without a PDU after which an entity is
    /// gone.
    static constexpr double kHeartbeat = 5, kTimeout = 2.4 * kHeartbeat;

    /// `scene` must outlive it. In a scene without such nodes it only looks at changes.
    explicit DisNetwork(Scene& scene, DisOptions options = {},
                        std::unique_ptr<DisTransport> transport = udpTransport());
    ~DisNetwork();
    DisNetwork(const DisNetwork&) = delete;
    DisNetwork& operator=(const DisNetwork&) = delete;

    /// Call it before the frame at `t`, on the scene's clock: the datagrams that have come go into the frame.
    void receive(double t);
    /// Call it after a frame: sends what the frame has caused.
    void send();

    struct Counts {
        std::uint64_t datagrams = 0, heard = 0, unreadable = 0, sent = 0;  // heard: PDUs that went to a node
        std::size_t addresses = 0, entities = 0;                           // now; entities: of all managers
    };
    Counts counts() const;

    class Stations;

  private:
    std::unique_ptr<Stations> stations_;
};

}  // namespace rtsg
