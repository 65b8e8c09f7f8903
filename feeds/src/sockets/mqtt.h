// Loads the module for MQTT when a place is on a broker.
#pragma once

#include <memory>

#include <rtsg/core/diagnostic.h>

#include "endpoint.h"
#include "mqtt_module.h"

namespace rtsg::feeds {

/// Sets host, topic and port of the settings from the endpoint, and what authenticates us from the environment:
/// MQTT_USER, MQTT_PASSWORD, and for mqtts:// the files MQTT_CA, MQTT_CERT and MQTT_KEY. Errors: no module; those of
/// the broker or the system.
Result<std::unique_ptr<MqttModule>> startMqtt(const Endpoint& endpoint, MqttSettings settings);

}  // namespace rtsg::feeds
