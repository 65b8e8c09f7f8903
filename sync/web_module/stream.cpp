// Hands each operation to the connection that there is, with or without TLS.
#include "stream.h"

namespace rtsg::web {

Stream::Stream(Tcp::socket&& socket, net::ssl::context* context) {
    if (context)
        tls_.emplace(std::move(socket), *context);
    else
        plain_.emplace(std::move(socket));
}

void Stream::handshake(Ended done) {
    tls_->async_handshake(net::ssl::stream_base::server, std::move(done));
}

void Stream::read(const Parts<net::mutable_buffer>& into, Moved then) {
    if (tls_)
        tls_->async_read_some(into, std::move(then));
    else
        plain_->async_read_some(into, std::move(then));
}

void Stream::write(const Parts<net::const_buffer>& from, Moved then) {
    if (tls_)
        tls_->async_write_some(from, std::move(then));
    else
        plain_->async_write_some(from, std::move(then));
}

void Stream::shutdown(Ended done) {
    if (tls_) return tls_->async_shutdown(std::move(done));
    beast::error_code error;
    (void)plain_->socket().shutdown(Tcp::socket::shutdown_send, error);
    net::post(get_executor(), [done = std::move(done), error]() mutable { done(error); });
}

void Stream::tearDown(beast::role_type role, beast::error_code& error) {
    using beast::websocket::teardown;
    if (tls_)
        teardown(role, *tls_, error);
    else
        teardown(role, plain_->socket(), error);
}

void Stream::tearDownLater(beast::role_type role, Ended then) {
    using beast::websocket::async_teardown;
    if (tls_)
        async_teardown(role, *tls_, std::move(then));
    else
        async_teardown(role, plain_->socket(), std::move(then));
}

}  // namespace rtsg::web
