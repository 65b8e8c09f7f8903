// Tables of common mistakes, each with the correct word for this program.
#include "hints.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <string_view>

#include <fmt/format.h>

#include <rtsg/sync/mirror_keys.h>

#include "command.h"

namespace rtsg::app {

namespace {

struct Slip {
    std::string_view typed;  // words separated by spaces
    std::string_view meant;
};

constexpr Slip kVerbs[] = {
    {"version", "rtsg --version"},
    {"man", "rtsg help --man"},
    {"show open display window gui", "rtsg view SCENE"},
    {"browse", "rtsg serve SCENE --web 8080, which shows it in a browser"},
    {"play playback seek", "rtsg replay LOG"},
    {"test rerun", "rtsg replay LOG --rerun SCENE"},
    {"blame", "rtsg replay LOG --blame NODE.field"},
    {"server host publish", "rtsg serve SCENE"},
    {"client connect follow subscribe join", "rtsg mirror ENDPOINT"},
    {"proxy forward", "rtsg relay ENDPOINT"},
    {"draw picture image raytrace trace screenshot film", "rtsg render SCENE -o OUT.png"},
    {"sound audio hear", "rtsg listen SCENE -o OUT.wav"},
    {"simulate step animate", "rtsg run SCENE"},
    {"log capture", "rtsg record SCENE -o LOG.rlog"},
    {"export import save translate", "rtsg convert IN OUT"},
    {"check lint verify", "rtsg validate FILE"},
    {"compare", "rtsg diff A B"},
    {"stats stat inspect describe dump list", "rtsg info FILE"},
    {"key keygen", "rtsg keys SERVER.key --client CLIENT.key"},
};

/// If a word has several lines, the first one whose option the verb has counts.
constexpr Slip kOptions[] = {
    {"-v -version", "--version"},
    {"-? -help /?", "--help"},
    {"--width --height --resolution --res -w", "--size 1280x720"},
    {"--duration --seconds --until -t", "--for"},
    {"--time", "--for"},
    {"--frames", "--for"},
    {"--begin --from --start", "--seek"},
    {"--begin --from --start --date", "--at"},
    {"--begin --from --start", "--time"},
    {"--framerate --frame-rate --hz", "--fps"},
    {"--camera --view --eye", "--viewpoint"},
    {"--samples --quality", "--spp"},
    {"--spp", "--samples"},
    {"--renderer --tracer", "--integrator"},
    {"--headphones", "--binaural"},
    {"--port --address --host --listen-on --endpoint -p", "--bind tcp://127.0.0.1:5570"},
    {"--browser --http --www --html", "--web"},
    {"--keys --auth --password", "--key"},
    {"--timeout --patience", "--wait"},
    {"--overwrite --replace -f -y", "--force"},
    {"--folder --root --dir --path", "--base"},
    {"--event --inject --input --send", "--set"},
    {"--print --events", "--watch"},
    {"--log", "--record"},
    {"--to --format --type", "--encoding"},
};

bool names(std::string_view words, std::string_view word) {
    for (std::size_t at = 0; at < words.size();) {
        const std::size_t end = std::min(words.find(' ', at), words.size());
        if (words.substr(at, end - at) == word) return true;
        at = end + 1;
    }
    return false;
}

bool isPort(std::string_view text) {
    unsigned port = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), port);
    return problem == std::errc() && end == text.data() + text.size() && port <= 65535;
}

bool isThere(const std::string& name) {
    std::error_code error;
    return std::filesystem::is_regular_file(name, error);
}

}  // namespace

std::string hintForVerb(const std::string& word) {
    for (const Slip& slip : kVerbs)
        if (names(slip.typed, word)) return std::string(slip.meant);
    if (isThere(word)) return "rtsg info " + word;
    if (word.starts_with("tcp://") || word.starts_with("ipc://")) return "rtsg mirror " + word;
    return {};
}

std::string hintForOption(const std::string& typed, const std::vector<std::string>& known) {
    for (const Slip& slip : kOptions) {
        const std::string option(slip.meant.substr(0, slip.meant.find(' ')));
        if (names(slip.typed, typed) && std::ranges::find(known, option) != known.end()) return std::string(slip.meant);
    }
    return {};
}

std::string hintForEndpoint(const std::string& typed) {
    if (isThere(typed)) return fmt::format("rtsg serve {}, and the endpoint that it names", typed);
    std::string_view rest = typed;
    for (const std::string_view scheme : {"tcp:", "http:", "https:", "ws:", "zmq:", "udp:"})
        if (rest.starts_with(scheme)) {
            rest.remove_prefix(scheme.size());
            break;
        }
    while (rest.starts_with('/')) rest.remove_prefix(1);
    while (rest.ends_with('/')) rest.remove_suffix(1);
    if (isPort(rest)) return fmt::format("tcp://127.0.0.1:{}", rest);
    const std::size_t colon = rest.rfind(':');
    std::string_view host = rest.substr(0, colon);
    const std::string_view port = colon == rest.npos ? "5570" : rest.substr(colon + 1);
    constexpr std::string_view kOfHosts = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-*";
    if (host.find_first_not_of(kOfHosts) != host.npos || (port != "*" && !isPort(port))) return {};
    // A single word is more likely something else than a host.
    if (colon == rest.npos && !host.contains('.') && host != "localhost") return {};
    if (host.empty() || host == "localhost") host = "127.0.0.1";
    return fmt::format("tcp://{}:{}", host, port);
}

void checkEndpoint(const std::string& option, const std::string& endpoint) {
    if (const auto local = isLocalEndpoint(endpoint); !local)
        throw UsageError(option, local.error().text, hintForEndpoint(endpoint));
    if (constexpr std::string_view name = "tcp://localhost:"; option == "--bind" && endpoint.starts_with(name))
        throw UsageError(option, endpoint + ": ZeroMQ serves at addresses and at interfaces, not at names",
                         "tcp://127.0.0.1:" + endpoint.substr(name.size()));
}

}  // namespace rtsg::app
