// MqttModule: what librtsg_mqtt.so offers, a client of an MQTT broker. Nothing else compiles or links its library.
//
// Invariant: the module links nothing of ours. Errors are sentences. A lost broker is looked for again and again.
// Threading: publish() on any thread; the functions of the settings are called on the module's thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace rtsg::feeds {

struct MqttSettings {
    std::string host, topic;
    std::uint16_t port = 1883;
    std::string user, password;  // empty: none
    bool encrypted = false;
    std::string authorities, certificate, key;  // files in PEM for `encrypted`; empty: the system's, and none
    std::uint32_t largest = 0;                  // bytes of a message; the broker is told to send no larger ones
    /// A message has come; null: nothing is subscribed to.
    std::function<void(std::string_view)> take;
    /// The broker is lost, found again, or refuses.
    std::function<void(std::string)> note;
};

class MqttModule {
  public:
    virtual ~MqttModule() = default;
    /// Sends a message to the topic, at most once. False if there is no broker now, or too much waits.
    virtual bool publish(std::string_view message) = 0;
};

/// Connects, and waits for the broker's answer, some seconds at most. Returns null and the reason if it fails.
using StartMqtt = std::unique_ptr<MqttModule> (*)(MqttSettings settings, std::string& problem);
/// The one symbol of the module: a function without arguments that returns a StartMqtt.
#define RTSG_MQTT_SYMBOL "rtsg_start_mqtt_2"

}  // namespace rtsg::feeds
