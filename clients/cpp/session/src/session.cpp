#include "wayfarer/session.hpp"

#include <algorithm>
#include <boost/beast/websocket.hpp>
#include <chrono>

#include "connection.hpp"
#ifdef WAYFARER_TLS
#include <boost/beast/websocket/ssl.hpp>
#endif

namespace wayfarer {
namespace {

namespace websocket = beast::websocket;
using boost::system::error_code;

constexpr double RETRY_FIRST = 0.5, RETRY_MOST = 8;  // seconds; doubled at each failure
constexpr double PAUSE = 0.1;  // least seconds between two texts
constexpr double SILENCE = 2.5;  // seconds without even a heartbeat (one per second) after which a connection is dead
constexpr std::chrono::seconds HANDSHAKE(10);
// close codes: 4000 + the HTTP status of the error
constexpr int ENDED = 1000, UNKNOWN_CALLER = 4401, FORBIDDEN = 4403, NOT_FOUND = 4404, INVALID = 4422;

double clock_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

template <class Stream>
class Socket : public Connection, public std::enable_shared_from_this<Socket<Stream>> {
 public:
  template <class... Rest>
  Socket(const Server& server, std::string target, const std::string& token, net::io_context& io, Rest&... rest)
      : server_(server), target_(std::move(target)), resolver_(io), socket_(io, rest...) {
    socket_.set_option(websocket::stream_base::decorator([token](websocket::request_type& request) {
      request.set(beast::http::field::sec_websocket_protocol, "wayfarer.v1");
      if (!token.empty()) request.set(beast::http::field::authorization, "Bearer " + token);
    }));
    socket_.read_message_max(MOST_BYTES);
  }

  void open() {
    resolver_.async_resolve(server_.host, server_.port, [self = this->shared_from_this()](error_code error, auto found) {
      if (self->lost(error)) return;
      auto& lowest = beast::get_lowest_layer(self->socket_);
      lowest.expires_after(HANDSHAKE);
      lowest.async_connect(found, [self](error_code failed, auto&&) {
        if (!self->lost(failed)) self->greet();
      });
    });
  }

  void say(const std::string& text) override {
    if (gone_ || writes_) return;
    writes_ = true;
    text_ = text;
    socket_.text(true);
    socket_.async_write(net::buffer(text_), [self = this->shared_from_this()](error_code error, std::size_t) {
      self->writes_ = false;
      self->lost(error);
    });
  }

  void close() override {
    gone_ = true;
    resolver_.cancel();
    beast::get_lowest_layer(socket_).cancel();
    error_code ignored;  // there is no one left to report it to
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

 private:
  void greet() {
#ifdef WAYFARER_TLS
    if constexpr (std::is_same_v<Stream, Secure>) {
      expect(socket_.next_layer(), server_.host);
      socket_.next_layer().async_handshake(
          net::ssl::stream_base::client, [self = this->shared_from_this()](error_code error) {
            if (!self->lost(error)) self->upgrade();
          });
      return;
    }
#endif
    upgrade();
  }

  void upgrade() {
    beast::get_lowest_layer(socket_).expires_never();  // the socket has its own limits
    socket_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::client));
    socket_.async_handshake(server_.host + ":" + server_.port, target_,
                            [self = this->shared_from_this()](error_code error) {
                              if (!self->lost(error)) self->listen();
                            });
  }

  void listen() {
    socket_.async_read(buffer_, [self = this->shared_from_this()](error_code error, std::size_t) {
      if (self->lost(error)) return;
      const auto bytes = self->buffer_.cdata();
      self->received(static_cast<const std::uint8_t*>(bytes.data()), bytes.size());
      self->buffer_.consume(self->buffer_.size());
      if (!self->gone_) self->listen();
    });
  }

  bool lost(error_code error) {
    if (gone_) return true;
    if (!error) return false;
    gone_ = true;
    const auto& reason = socket_.reason();
    if (error == websocket::error::closed) closed(reason.code, std::string(reason.reason.c_str()));
    else closed(0, error.message());
    return true;
  }

  Server server_;
  std::string target_;
  net::ip::tcp::resolver resolver_;
  websocket::stream<Stream> socket_;
  beast::flat_buffer buffer_;
  std::string text_;  // being written
  bool gone_ = false, writes_ = false;
};

}  // namespace

struct MotionStream::Impl {
  Impl(const Api& calls, std::string id, std::map<std::string, std::string> asked, MotionPlayer& plays,
       StreamEvents tells)
      : api(calls),
        session_id(std::move(id)),
        route(calls.homes(), session_id),
        wish(std::move(asked)),
        player(plays),
        on(std::move(tells)) {}

  const Api& api;
  std::string session_id;
  Route route;
  std::map<std::string, std::string> wish;
  MotionPlayer& player;
  StreamEvents on;
  net::io_context io{1};
  std::shared_ptr<Connection> connection;
  std::string forgotten;  // a resume token unknown to the server
  std::string text, said;  // waiting to be sent; the last one given
  bool begun = false;      // this connection's header has come
  bool moved = false;      // the route says where to connect
  double said_at = -PAUSE;
  double now = 0, retry = RETRY_FIRST, connect_at = 0, heard_at = 0;
  bool over = false;

  void tell(const std::string& status, const std::string& detail = "") {
    if (on.status) on.status(status, detail);
  }

  std::string target() const {
    std::string query = "/v1/stream?session=" + url_encoded(session_id);
    for (const auto& [key, value] : wish) query += "&" + url_encoded(key) + "=" + url_encoded(value);
    const std::string& token = player.resume_token();
    if (!token.empty() && token != forgotten) query += "&resume_token=" + url_encoded(token);
    return query;
  }

  template <class Stream, class... Rest>
  void open(const Server& server, Rest&... rest) {
    const auto socket = std::make_shared<Socket<Stream>>(server, target(), api.token(), io, rest...);
    socket->received = [this](const std::uint8_t* bytes, std::size_t size) { receive(bytes, size); };
    socket->closed = [this](int code, const std::string& reason) { lost(code, reason); };
    connection = socket;
    socket->open();
  }

  void connect() {
    tell("connecting");
    player.begin();
    begun = false;
    heard_at = now;
    if (!moved) route.begin();
    moved = false;
    const Server server(route.address());
#ifdef WAYFARER_TLS
    if (server.tls) return open<Secure>(server, trust());
#endif
    open<Plain>(server);
  }

  void end(const std::string& reason) {
    over = true;
    drop();
    if (on.ended) on.ended(reason);
  }

  void drop() {
    if (connection) connection->close();
    connection.reset();
  }

  void receive(const std::uint8_t* bytes, std::size_t size) {
    heard_at = now;
    MessageKind kind;
    try {
      kind = player.receive(bytes, size, now);
    } catch (const DecodeError& error) {
      return end(std::string("cannot read the stream: ") + error.what());
    }
    if (kind != MessageKind::header) return;
    retry = RETRY_FIRST;
    begun = true;
    route.answered();
    tell("open");
  }

  void lost(int code, const std::string& reason) {
    drop();
    const std::string token = player.resume_token();
    if (code == INVALID && !token.empty() && token != forgotten) {
      forgotten = token;  // perhaps of another server: begin with the frames that fall due next
      connect_at = now;
    } else if (code == ENDED || code == NOT_FOUND || code == UNKNOWN_CALLER || code == FORBIDDEN || code == INVALID) {
      end(reason);
    } else if (route.closed(code, reason)) {
      moved = true;
      connect_at = now;
    } else {
      tell("lost", reason);
      connect_at = now + retry;
      retry = std::min(RETRY_MOST, 2 * retry);
    }
  }

  void poll() {
    if (over) return;
    if (!connection && now >= connect_at) connect();
    if (connection && begun && !text.empty() && now - said_at >= PAUSE) {
      connection->say(text);
      text.clear();
      said_at = now;
    }
    io.restart();
    io.poll();
    // a half-open connection never closes by itself
    if (connection && now - heard_at > SILENCE) lost(0, "nothing came for 2.5 s");
  }
};

MotionStream::MotionStream(const Api& api, const std::string& session_id,
                           const std::map<std::string, std::string>& wish, MotionPlayer& player, StreamEvents on)
    : impl_(std::make_unique<Impl>(api, session_id, wish, player, std::move(on))) {}

MotionStream::~MotionStream() { close(); }

void MotionStream::wish(const std::string& key, const std::string& value) { impl_->wish[key] = value; }

void MotionStream::say(const std::string& text) {
  if (text == impl_->said) return;
  impl_->text = impl_->said = text;
}

void MotionStream::poll(double now) {
  impl_->now = now;
  impl_->poll();
}

void MotionStream::close() {
  impl_->over = true;
  impl_->drop();
}

Session Session::open(const std::string& server, SessionOptions options) {
  auto api = std::make_unique<Api>(server, options.token);
  const std::string id = api->create_session(options.session).at("session_id");
  return {std::move(api), id, true, std::move(options)};
}

Session Session::join(const std::string& server, const std::string& id, SessionOptions options) {
  return {std::make_unique<Api>(server, options.token), id, false, std::move(options)};
}

Session::Session(std::unique_ptr<Api> api, std::string id, bool own, SessionOptions options)
    : api_(std::move(api)),
      id_(std::move(id)),
      interest_(std::move(options.interest)),
      own_(own),
      player_(std::make_unique<MotionPlayer>(std::move(options.on))),
      stream_(std::make_unique<MotionStream>(*api_, id_, options.wish, *player_, std::move(options.stream))) {
  if (!interest_.is_null()) stream_->wish("interest", interest_.dump());
}

void Session::look(const Json& viewpoints) {
  if (interest_.is_null()) throw std::logic_error("the session was opened without `interest`");
  interest_["viewpoints"] = viewpoints;
  stream_->wish("interest", interest_.dump());
  stream_->say(Json{{"viewpoints", viewpoints}}.dump());
}

Session::~Session() {
  if (!stream_) return;  // moved away
  stream_->close();
  if (!own_) return;
  try {
    api_->delete_session(id_);
  } catch (const std::exception&) {  // its lease will end it
  }
}

void Session::update() {
  const double now = clock_now();
  stream_->poll(now);
  player_->advance(now);
}

}  // namespace wayfarer
