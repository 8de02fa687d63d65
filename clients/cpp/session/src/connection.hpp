// Shared by HTTP and WebSocket: plain or TLS streams of Boost.Beast.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <cstdint>
#include <functional>
#include <string>

#include "wayfarer/api.hpp"

#ifdef WAYFARER_TLS
#include <boost/asio/ssl.hpp>
#include <boost/beast/ssl.hpp>
#endif

namespace wayfarer {

namespace net = boost::asio;
namespace beast = boost::beast;
using Plain = beast::tcp_stream;

constexpr std::size_t MOST_BYTES = 64 << 20;  // of an answer, or of a message

/// One connection, which keeps received messages until they are asked for.
class Connection {
 public:
  virtual ~Connection() = default;
  virtual void close() = 0;
  virtual void say(const std::string& text) = 0;  // one at a time

  std::function<void(const std::uint8_t*, std::size_t)> received;
  std::function<void(int code, const std::string& reason)> closed;
};

#ifdef WAYFARER_TLS
using Secure = beast::ssl_stream<beast::tcp_stream>;

/// Trusts the machine's authorities (SSL_CERT_FILE names others).
inline net::ssl::context& trust() {
  static net::ssl::context context = [] {
    net::ssl::context made(net::ssl::context::tls_client);
    made.set_options(net::ssl::context::default_workarounds | net::ssl::context::no_tlsv1 |
                     net::ssl::context::no_tlsv1_1);
    made.set_default_verify_paths();
    made.set_verify_mode(net::ssl::verify_peer);
    return made;
  }();
  return context;
}

/// Set the host name that we expect.
inline void expect(Secure& stream, const std::string& host) {
  SSL_set_tlsext_host_name(stream.native_handle(), host.c_str());
  stream.set_verify_callback(net::ssl::host_name_verification(host));
}
#endif

}  // namespace wayfarer
