// Finds the module for MQTT, and connects.
#include "mqtt.h"

#include <cstdlib>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/module.h>

namespace rtsg::feeds {

Result<std::unique_ptr<MqttModule>> startMqtt(const Endpoint& endpoint, MqttSettings settings) {
#ifdef RTSG_NO_MQTT
    (void)settings;
    return fail(fmt::format("{}: this build leaves MQTT out (libmosquitto-dev, RTSG_MQTT)", endpoint.text));
#else
    const auto symbol = loadModule("rtsg_mqtt", RTSG_MQTT_SYMBOL, "feeds by MQTT need");
    if (!symbol) return std::unexpected(symbol.error());
    settings.host = endpoint.host;
    settings.topic = endpoint.topic;
    settings.port = endpoint.port;
    settings.encrypted = endpoint.encrypted;
    const std::pair<const char*, std::string*> variables[] = {{"MQTT_USER", &settings.user},
                                                              {"MQTT_PASSWORD", &settings.password},
                                                              {"MQTT_CA", &settings.authorities},
                                                              {"MQTT_CERT", &settings.certificate},
                                                              {"MQTT_KEY", &settings.key}};
    for (const auto& [name, setting] : variables)
        if (const char* const value = std::getenv(name)) *setting = value;
    std::string problem;
    auto module = reinterpret_cast<StartMqtt (*)()>(*symbol)()(std::move(settings), problem);
    if (!module) return fail(fmt::format("{}: {}", endpoint.text, problem));
    return module;
#endif
}

}  // namespace rtsg::feeds
