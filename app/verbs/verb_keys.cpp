// rtsg keys: makes the key files of a server and of its clients.
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include <rtsg/sync/mirror_keys.h>

#include "cli.h"

namespace rtsg::app {

namespace {

struct KeyArguments {
    std::string server, client, upstream, name;
};

int makeKeys(const KeyArguments& options) {
    if (options.client.empty() && !options.upstream.empty()) throw UsageError("--upstream", "is of --client");
    if (options.upstream.empty() && !options.name.empty())
        throw UsageError("--name", "needs --upstream: a key file has both, or neither");
    if (!std::filesystem::exists(options.server)) {
        if (auto ok = MirrorKeys::generate(options.server); !ok) return printError(ok.error()), kBad;
        fmt::print("{}: for rtsg serve --key; it stays on the server\n", options.server);
    } else if (options.client.empty()) {
        return printError(options.server + ": there is a file already; --client lets one more in"), kBad;
    }
    if (options.client.empty()) return kDone;
    if (auto ok = MirrorKeys::addClient(options.server, options.client, options.upstream, options.name); !ok)
        return printError(ok.error()), kBad;
    fmt::print("{}: for rtsg mirror --key; copy it to the machine that follows\n", options.client);
    return kDone;
}

}  // namespace

Verb addKeys(Command& program) {
    auto options = std::make_shared<KeyArguments>();
    Command* command = program.addVerb("keys", "Make the key files of a server and of its mirrors");
    command->addOption("SERVER", options->server, "the server's key file; made if there is none")->required();
    command->addOption("--client", options->client,
                       "key file to make for one more mirror or relay, whose key is added to SERVER");
    command->addOption("--upstream", options->upstream, "what this client may send; overrides the server's --upstream")
        ->oneOf({"none", "events", "edits", "code"});
    command->addOption("--name", options->name, "name of the key's holder, in logs and for undo; needs --upstream");
    command->footer(
        "Example: rtsg keys hall.key --client laptop.key\n"
        "Example: rtsg keys hall.key --client kim.key --upstream edits --name Kim\n"
        "A server reads its file when it starts.");
    return {command, [options] { return makeKeys(*options); }};
}

}  // namespace rtsg::app
