// Messages of an editor of any kind, a line each: the language server answers, and each answer is JSON.
#include <cstdint>
#include <cstdlib>

#include <nlohmann/json.hpp>

#include <rtsg/documents/language_server.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string_view rest(reinterpret_cast<const char*>(data), size);
    rtsg::LanguageServerOptions options;
    options.maximumBytes = 1 << 16, options.maximumDocuments = 4;
    rtsg::LanguageServer server(options, [](std::string_view message) {
        if (!nlohmann::json::accept(message)) std::abort();
    });
    while (!rest.empty() && !server.hasEnded()) {
        const std::size_t end = std::min(rest.find('\n'), rest.size());
        server.receive(rest.substr(0, end));
        rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    for (int i = 0; i < 8 && server.hasWork(); ++i) server.work();
    return 0;
}
