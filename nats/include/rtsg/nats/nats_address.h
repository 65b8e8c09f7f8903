// NatsAddress: a session at a NATS server, as nats://[USER:PASSWORD@]HOST[:PORT][,HOST[:PORT]...]/NAME.
//
// tls:// in place of nats:// asks for encryption. NAME is a part of subjects, so it is made of letters, digits, '-' and
// '_'. Port 4222 need not be named. What authenticates us (user and password, or a token alone before the @) goes to
// the NATS server and into no text of ours.
// Threading: values.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct NatsAddress {
    std::vector<std::string> servers;  // as urls, with what authenticates us
    std::string secret;                // that part alone; empty if there is none
    std::string name;
    std::string shown;  // the address without secrets, for messages

    /// Errors: no host, a port that is none, a name with other characters or of more than 64. They do not repeat the
    /// text, as it may have a password in it.
    static Result<NatsAddress> parse(std::string_view text);
};

/// True if the text begins as such an address does.
bool isNatsAddress(std::string_view text);

}  // namespace rtsg
