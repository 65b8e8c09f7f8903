// Opens connections to NATS servers: finds the module, and keeps secrets out of what it says.
//
// Threading: any thread.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/nats/nats_address.h>

#include "nats_link.h"

namespace rtsg {

/// The text without user, password and token.
std::string withoutSecrets(std::string text, const NatsAddress& address);

/// Tries for `patience`, as the server may be about to start. Errors: this build or machine lacks the module; no
/// connection; the server takes messages of less than 16 KiB.
Result<std::unique_ptr<NatsLink>> openNatsLink(const NatsAddress& address, const std::string& client,
                                               std::chrono::milliseconds patience = std::chrono::milliseconds(0));

/// The events of a connection since the last call, in sentences without secrets: that it was lost or made again, and
/// the NATS server's complaints.
class NatsEvent {
  public:
    std::vector<std::string> take(NatsLink& link, const NatsAddress& address);

  private:
    bool connected_ = true;
};

/// Subjects of a session.
struct NatsSubjects {
    explicit NatsSubjects(const std::string& name)
        : live("rtsg." + name + ".live"),
          state("rtsg." + name + ".state"),
          ask("rtsg." + name + ".ask"),
          log("rtsg." + name + ".log") {}
    std::string live;   // every new record, pings and the goodbye
    std::string state;  // the last keyframe and the frames after it, when a client has asked
    std::string ask;    // what mirrors send to the server
    std::string log;    // records of a stored session
};

}  // namespace rtsg
