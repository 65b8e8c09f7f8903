// Starts the gateway for browsers, and prints the page's address.
#include "web.h"

#include <cstdio>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "cli.h"
#include "say.h"

namespace rtsg::app {

void WebArguments::addTo(Command& command) {
    const Command::Section section(command, "Browsers");
    command.addOption(
        "--web", listen,
        "PORT, or ADDRESS:PORT beyond this machine: a page that follows, shows and compares; 0 picks a port");
    command.addOption(
        "--web-token", token,
        "what a browser has to know; beyond this machine one is made up if none is given, and printed with "
        "the page's address");
    command.addOption("--web-cert", certificate,
                      "PEM file: serve by TLS with this certificate (and those that vouch for it)");
    command.addOption("--web-key", privateKey, "PEM file: its private key");
}

void WebArguments::check() const {
    if (!wanted()) {
        if (!token.empty()) throw UsageError("--web-token", "only together with --web");
        if (!certificate.empty()) throw UsageError("--web-cert", "only together with --web");
        if (!privateKey.empty()) throw UsageError("--web-key", "only together with --web");
        return;
    }
    // Tests one option after the other, so that the error names the wrong one.
    WebGatewayOptions options;
    const auto expect = [&](const char* option) {
        if (auto ok = options.check(); !ok) throw UsageError(option, ok.error().text);
    };
    options.listen = listen;
    expect("--web");
    options.token = token;
    expect("--web-token");
    options.certificate = certificate;
    options.privateKey = privateKey;
    expect(certificate.empty() ? "--web-key" : "--web-cert");
}

Result<Web> Web::start(const WebArguments& arguments, const MirrorServer& server,
                       const std::optional<MirrorKeys>& keys) {
    Web web;
    if (!arguments.wanted()) return web;
    WebGatewayOptions options;
    options.listen = arguments.listen;
    options.token = arguments.token;
    options.certificate = arguments.certificate;
    options.privateKey = arguments.privateKey;
    options.endpoint = server.endpoint();
    options.keys = keys;
    options.call = server.callDescriptor();
    auto gateway = WebGateway::start(std::move(options));
    if (!gateway) return std::unexpected(gateway.error());
    web.gateway_ = std::move(*gateway);
    return web;
}

void Web::service(const Scene& scene, const Resources& resources) {
    if (!gateway_) return;
    gateway_->service(scene, resources);
    for (const Diagnostic& d : gateway_->takeDiagnostics()) say(d);
}

void sayEndpoint(const std::string& words, const MirrorServer& server, const Web& web, bool json,
                 const std::string& nats, const std::string& more) {
    if (json) {
        const std::string page = web.url().empty() ? "" : fmt::format(",\"web\":{}", jsonString(web.url()));
        const std::string published = nats.empty() ? "" : fmt::format(",\"nats\":{}", jsonString(nats));
        fmt::print("{{\"endpoint\":{}{}{}{}}}\n", jsonString(server.endpoint()), page, published, more);
    } else {
        fmt::print("{} {}\n", words, server.endpoint());
        if (!web.url().empty()) fmt::print("page at {}\n", web.url());
        if (!nats.empty()) fmt::print("published at {}\n", nats);
    }
    std::fflush(stdout);
}

}  // namespace rtsg::app
