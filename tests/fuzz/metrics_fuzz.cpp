// Bytes of any kind to the server of metrics, and as the answer of one: requests are answered by HTTP, and figures are
// fetched or an error.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <thread>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <rtsg/feeds/metrics_server.h>

namespace {

using namespace rtsg;

sockaddr_in loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET, address.sin_port = htons(port), address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

void ask(std::uint16_t port, std::string_view request) {
    const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in to = loopback(port);
    if (::connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) != 0) std::abort();
    (void)::send(socket, request.data(), request.size(), MSG_NOSIGNAL);
    ::shutdown(socket, SHUT_WR);
    std::string answer(1 << 12, '\0');
    const ssize_t got = ::recv(socket, answer.data(), answer.size(), 0);
    if (got > 0 && !answer.starts_with("HTTP/1.1 ")) std::abort();
    if (got > 0 && answer.starts_with("HTTP/1.1 200 ") && answer.find("rtsg_up 1") == answer.npos &&
        !request.starts_with("HEAD"))
        std::abort();
    ::close(socket);
}

/// Answers one who connects with the bytes, after the beginning of a good answer.
void answerWith(std::string_view bytes) {
    const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in at = loopback(0);
    socklen_t length = sizeof(at);
    if (::bind(listener, reinterpret_cast<const sockaddr*>(&at), sizeof(at)) != 0 || ::listen(listener, 1) != 0 ||
        ::getsockname(listener, reinterpret_cast<sockaddr*>(&at), &length) != 0)
        std::abort();
    std::thread server([&] {
        const int one = ::accept(listener, nullptr, nullptr);
        char request[512];
        (void)!::recv(one, request, sizeof(request), 0);
        (void)::send(one, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        ::close(one);
    });
    const auto text = fetchMetrics(std::to_string(ntohs(at.sin_port)));
    if (text && !bytes.starts_with("HTTP/1.1 200 ")) std::abort();
    server.join();
    ::close(listener);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const auto server = MetricsServer::start("0", false, [] { return std::string("rtsg_up 1\n"); });
    if (!server) std::abort();
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    const std::string& address = (*server)->address();
    ask(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))), bytes);
    answerWith(bytes);
    return 0;
}
