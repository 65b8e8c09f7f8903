// Loads the module for MQTT when a place is on a broker.
#pragma once

#include <memory>

#include <rtsg/core/diagnostic.h>

#include "mqtt_module.h"
#include "place.h"

namespace rtsg::feeds {

/// Sets host, topic and port of the settings from the place. Errors: no module; those of the broker or the system.
Result<std::unique_ptr<MqttModule>> startMqtt(const Place& place, MqttSettings settings);

}  // namespace rtsg::feeds
