// nats:// and tls:// addresses on the command line: publishing what a verb serves, and following it from there.
//
// Threading: one thread.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <rtsg/nats/mirror_origin.h>
#include <rtsg/nats/nats_address.h>
#include <rtsg/nats/nats_publisher.h>
#include <rtsg/sync/mirror_server.h>

#include "command.h"

namespace rtsg::app {

/// Where a verb follows a scene. Throws UsageError for what is neither an endpoint nor an address of a NATS server, and
/// for a key file with the latter. Tries for `patience` seconds to connect to a NATS server. Error: no connection.
Result<MirrorOrigin> openOrigin(const std::string& typed, const std::string& key, double patience);
/// Says what has happened to the connection.
void printNews(MirrorOrigin& origin);

/// Publishes what a verb serves, if NATS was asked for.
class Published {
  public:
    /// `address` may be empty. Throws UsageError if it is none.
    static Result<Published> start(const std::string& address, MirrorServer& server,
                                   const std::optional<MirrorKeys>& keys);
    /// Without secrets; empty if nothing is published.
    std::string address() const { return publisher_ ? publisher_->address() : std::string(); }
    void printNews();
    /// True if something was not published and never will be.
    bool failed() const { return failed_; }
    /// Call it after the server's end, so that mirrors get its goodbye.
    void end() { publisher_.reset(); }

  private:
    std::unique_ptr<NatsPublisher> publisher_;
    bool failed_ = false;
};

/// Throws UsageError if this is no address of a session at a NATS server.
void checkNatsAddress(const std::string& option, const std::string& address);

}  // namespace rtsg::app
