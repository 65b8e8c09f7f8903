// Stream: a browser's connection, with or without TLS, in the form that Boost.Beast expects.
//
// Invariant: TLS never changes during a connection.
// Threading: the gateway's thread.
#pragma once

#include <optional>
#include <utility>

#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>

#include "gateway.h"

namespace rtsg::web {

// Beast looks for some of these names.
// NOLINTBEGIN(readability-identifier-naming)
class Stream {
  public:
    using Tls = beast::ssl_stream<beast::tcp_stream>;
    using executor_type = beast::tcp_stream::executor_type;

    /// With `context` null there is no TLS.
    Stream(Tcp::socket&& socket, net::ssl::context* context) {
        if (context)
            tls_.emplace(std::move(socket), *context);
        else
            plain_.emplace(std::move(socket));
    }
    executor_type get_executor() { return tcp().get_executor(); }
    beast::tcp_stream& tcp() { return tls_ ? tls_->next_layer() : *plain_; }

    /// Calls `done(error)`. Precondition: the stream has TLS.
    template <class Done>
    void handshake(Done&& done) {
        tls_->async_handshake(net::ssl::stream_base::server, std::forward<Done>(done));
    }
    template <class Buffers, class Handler>
    auto async_read_some(const Buffers& buffers, Handler&& handler) {
        return net::async_initiate<Handler, void(beast::error_code, std::size_t)>(
            [this](auto&& then, const Buffers& into) {
                if (tls_)
                    tls_->async_read_some(into, std::forward<decltype(then)>(then));
                else
                    plain_->async_read_some(into, std::forward<decltype(then)>(then));
            },
            handler, buffers);
    }
    template <class Buffers, class Handler>
    auto async_write_some(const Buffers& buffers, Handler&& handler) {
        return net::async_initiate<Handler, void(beast::error_code, std::size_t)>(
            [this](auto&& then, const Buffers& from) {
                if (tls_)
                    tls_->async_write_some(from, std::forward<decltype(then)>(then));
                else
                    plain_->async_write_some(from, std::forward<decltype(then)>(then));
            },
            handler, buffers);
    }
    /// Sends what was written and ends the connection; then calls `done(error)`.
    template <class Done>
    void shutdown(Done&& done) {
        if (tls_) return tls_->async_shutdown(std::forward<Done>(done));
        beast::error_code error;
        (void)plain_->socket().shutdown(Tcp::socket::shutdown_send, error);
        net::post(get_executor(), [done = std::forward<Done>(done), error]() mutable { done(error); });
    }

    // Beast calls these to end a WebSocket's connection; it finds them by their arguments.
    friend void teardown(beast::role_type role, Stream& stream, beast::error_code& error) {
        using beast::websocket::teardown;
        if (stream.tls_)
            teardown(role, *stream.tls_, error);
        else
            teardown(role, stream.plain_->socket(), error);
    }
    template <class Handler>
    friend void async_teardown(beast::role_type role, Stream& stream, Handler&& handler) {
        using beast::websocket::async_teardown;
        if (stream.tls_)
            async_teardown(role, *stream.tls_, std::forward<Handler>(handler));
        else
            async_teardown(role, stream.plain_->socket(), std::forward<Handler>(handler));
    }
    friend void beast_close_socket(Stream& stream) { stream.tcp().close(); }

  private:
    std::optional<beast::tcp_stream> plain_;
    std::optional<Tls> tls_;
};
// NOLINTEND(readability-identifier-naming)

}  // namespace rtsg::web
