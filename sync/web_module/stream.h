// Stream: a browser's connection, with or without TLS, in the form that Boost.Beast expects.
//
// What is to be done afterwards, and the buffers, have one type each below here: TLS, timeouts and sockets are compiled
// once then, and not once for each of Beast's operations by each caller, which made this module the slowest to compile.
//
// Invariant: TLS never changes during a connection.
// Threading: the gateway's thread.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <utility>

#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>

#include "http_server.h"

namespace rtsg::web {

/// What is done after bytes have moved, or after anything else. Callers name them, too, so that they share Beast's
/// operations.
using Moved = std::move_only_function<void(beast::error_code, std::size_t)>;
using Ended = std::move_only_function<void(beast::error_code)>;

/// The first buffers of a sequence, which are enough for an operation that moves some bytes: empty only if all are.
// Asio and Beast look for some of these names.
// NOLINTBEGIN(readability-identifier-naming)
template <class Buffer>
class Parts {
  public:
    using value_type = Buffer;
    using const_iterator = const Buffer*;

    template <class Buffers>
    explicit Parts(const Buffers& buffers) {
        const auto end = net::buffer_sequence_end(buffers);
        for (auto at = net::buffer_sequence_begin(buffers); at != end && count_ < kMax; ++at)
            if (const Buffer one(*at); one.size() != 0) parts_[count_++] = one;
    }
    const_iterator begin() const { return parts_.data(); }
    const_iterator end() const { return parts_.data() + count_; }

  private:
    static constexpr std::size_t kMax = 16;
    std::array<Buffer, kMax> parts_;
    std::size_t count_ = 0;
};

class Stream {
  public:
    using Tls = beast::ssl_stream<beast::tcp_stream>;
    using executor_type = beast::tcp_stream::executor_type;

    /// With `context` null there is no TLS.
    Stream(Tcp::socket&& socket, net::ssl::context* context);
    executor_type get_executor() { return tcp().get_executor(); }
    beast::tcp_stream& tcp() { return tls_ ? tls_->next_layer() : *plain_; }

    /// Precondition: the stream has TLS.
    void handshake(Ended done);
    template <class Buffers, class Handler>
    auto async_read_some(const Buffers& buffers, Handler&& handler) {
        return net::async_initiate<Handler, void(beast::error_code, std::size_t)>(
            [this](auto&& then, const Buffers& into) {
                read(Parts<net::mutable_buffer>(into), Moved(std::forward<decltype(then)>(then)));
            },
            handler, buffers);
    }
    template <class Buffers, class Handler>
    auto async_write_some(const Buffers& buffers, Handler&& handler) {
        return net::async_initiate<Handler, void(beast::error_code, std::size_t)>(
            [this](auto&& then, const Buffers& from) {
                write(Parts<net::const_buffer>(from), Moved(std::forward<decltype(then)>(then)));
            },
            handler, buffers);
    }
    /// Sends what was written and ends the connection.
    void shutdown(Ended done);

    // Beast calls these to end a WebSocket's connection; it finds them by their arguments.
    friend void teardown(beast::role_type role, Stream& stream, beast::error_code& error) {
        stream.tearDown(role, error);
    }
    template <class Handler>
    friend void async_teardown(beast::role_type role, Stream& stream, Handler&& handler) {
        stream.tearDownLater(role, Ended(std::forward<Handler>(handler)));
    }
    friend void beast_close_socket(Stream& stream) { stream.tcp().close(); }

  private:
    void read(const Parts<net::mutable_buffer>& into, Moved then);
    void write(const Parts<net::const_buffer>& from, Moved then);
    void tearDown(beast::role_type role, beast::error_code& error);
    void tearDownLater(beast::role_type role, Ended then);

    std::optional<beast::tcp_stream> plain_;
    std::optional<Tls> tls_;
};
// NOLINTEND(readability-identifier-naming)

}  // namespace rtsg::web
