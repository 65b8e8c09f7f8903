// NatsAddress: a session at a NATS server, as nats://[USER:PASSWORD@]HOST[:PORT][,HOST[:PORT]...]/NAME.
//
// tls:// in place of nats:// asks for encryption. NAME is a part of subjects, so it consists of letters, digits, '-'
// and '_'. Port 4222 is the default. Credentials (user and password, or a token alone before the @) go to the NATS
// server and appear in no message. Without them those of the environment do: NATS_USER and NATS_PASSWORD, or the file
// NATS_CREDS. NATS_CA, NATS_CERT and NATS_KEY are files for tls://. Threading: values.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct NatsAddress {
    std::vector<std::string> servers;  // as urls with credentials
    std::string secret;                // the credentials alone; empty if there are none
    std::string name;
    std::string shown;  // the address without secrets, for messages

    /// Errors: no host; an invalid port; a name with other characters or more than 64. Errors do not repeat the text,
    /// since it may contain a password.
    static Result<NatsAddress> parse(std::string_view text);
};

/// Whether the text begins like such an address.
bool isNatsAddress(std::string_view text);

}  // namespace rtsg
