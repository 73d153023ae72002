// Controller and plant talk through a Link: LCM between two processes, queues within one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "quasilpv/message_key.hpp"
#include "quasilpv/messages.hpp"
#include "quasilpv/peer_watch.hpp"

namespace quasilpv {

/// What a link received and what it refused; every packet is counted exactly once among the first
/// thirteen.
struct LinkCounters {
  std::int64_t accepted = 0;
  std::int64_t duplicates = 0;     ///< the newest sequence number once more
  std::int64_t old = 0;            ///< a lower sequence number than the newest
  std::int64_t not_authentic = 0;  ///< authenticated mode: no tag, that of another key, or an event once more
  std::int64_t wrong_length = 0;
  std::int64_t wrong_checksum = 0;
  std::int64_t wrong_type = 0;
  std::int64_t wrong_session = 0;
  std::int64_t wrong_artifact = 0;     ///< hash or number of joints or signals differ
  std::int64_t out_of_bounds = 0;      ///< a number or code that no side sends
  std::int64_t second_sender = 0;      ///< of another sender than the peer, or for another receiver, or a contradiction
  std::int64_t other_mode = 0;         ///< of a sender that runs in another mode or at another rate
  std::int64_t unfit_events = 0;       ///< events of somebody who is not part of the run, or of another moment of it
  std::int64_t consecutive_wrong = 0;  ///< packets of a wrong session or artifact since the last right one
  std::int64_t superseded = 0;         ///< accepted, but a newer one arrived before it was taken
  std::int64_t lost_events = 0;        ///< accepted, but more were waiting than are kept
  std::int64_t send_failures = 0;
};

/// One end of the wire.
///
/// Sending stamps and seals a message; receiving drains everything that is pending and keeps, per type, the message
/// with the highest sequence number: a queue that holds the *oldest* message back would add its age to the loop delay.
/// What is not ours (decode()) is dropped and counted, and so is what comes from a sender that is not part of the run
/// (PeerWatch). Transports implement transmit() and drain(), nothing else. One
/// thread per link: no member may be called concurrently with another.
class Link {
 public:
  virtual ~Link() = default;
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  /// From now on a tag is put behind every message sent, and only messages with the right one are accepted. INIT-ONLY.
  void authenticate_with(const MessageKey& key) { key_ = key; }
  bool is_authenticated() const noexcept { return key_.has_value(); }

  /// Fills in what all messages have in common, in a copy of the message, and hands it to the transport; a failure is
  /// counted. RT-UNSAFE (system call); allocates nothing itself and never throws.
  void send(const measurement_v3& message) noexcept;
  void send(const command_v2& message) noexcept;
  void send(const telemetry_v2& message) noexcept;
  void send(const TelemetrySample& sample) noexcept { send(to_message(sample)); }
  void send(const signals_measurement_v1& message) noexcept;
  void send(const signals_command_v1& message) noexcept;
  void send(const signals_telemetry_v1& message) noexcept;
  void send(const SystemSample& sample) noexcept { send(to_message(sample)); }
  void send(EventCode code, std::int64_t seq, std::int64_t detail = 0, std::int64_t more = 0) noexcept;

  /// Waits until at least one packet arrived or `timeout_ns` passed (0: polls), then drains all. RT-UNSAFE (system
  /// call). Returns false if nothing arrived.
  bool receive(std::int64_t timeout_ns) noexcept;

  /// Takes the newest message out, true if there is one that was not taken yet. A duplicate of the newest message can
  /// be taken again: lock-step answers it. RT-SAFE.
  bool take(measurement_v3& message) noexcept { return measurement_.take(message); }
  bool take(command_v2& message) noexcept { return command_.take(message); }
  bool take(signals_measurement_v1& message) noexcept { return signals_measurement_.take(message); }
  bool take(signals_command_v1& message) noexcept { return signals_command_.take(message); }

  /// Takes the oldest event out: each of them counts, so they are kept in order, at most 8. RT-SAFE.
  bool take(event_v2& event) noexcept { return events_.take(event); }

  /// Longest run of packets of a wrong session or artifact that touched the time since the last call. A right packet
  /// that ends such a run does not hide it. RT-SAFE.
  std::int64_t take_longest_wrong_run() noexcept;

  /// Who is speaking. RT-SAFE.
  PeerWatch& peers() noexcept { return peers_; }
  const PeerWatch& peers() const noexcept { return peers_; }

  /// Name of this end, in every message it sends.
  std::int64_t sender() const noexcept { return sender_; }
  /// Session of the last message of another session; nothing: there was none.
  std::optional<std::int64_t> foreign_session() const noexcept { return foreign_session_; }

  const LinkCounters& counters() const noexcept { return counters_; }
  const WireIdentity& identity() const noexcept { return identity_; }
  Side side() const noexcept { return side_; }

 protected:
  Link(Side side, const WireIdentity& identity)
      : side_(side), identity_(identity), sender_(new_sender()), peers_(side, identity.pace, identity.period_ns) {}

  virtual bool transmit(Channel channel, const void* bytes, std::size_t size) noexcept = 0;
  /// Waits as receive() does and calls accept() for each packet.
  virtual bool drain(std::int64_t timeout_ns) noexcept = 0;

  /// Judges one packet. RT-SAFE (bounded, no allocation, no lock, no throw).
  void accept(Channel channel, const void* bytes, std::size_t size) noexcept;

 private:
  template <class Message>
  struct Inbox {
    bool take(Message& message) noexcept {
      const bool taken = fresh;
      if (fresh) {
        message = newest;
        fresh = false;
      }
      return taken;
    }

    Message newest{};
    std::int64_t newest_seq = -1;
    bool fresh = false;
  };

  struct EventQueue {
    static constexpr std::size_t kCapacity = 8;

    bool put(const event_v2& event) noexcept;
    bool take(event_v2& event) noexcept;

    std::array<event_v2, kCapacity> events{};
    std::size_t first = 0;
    std::size_t count = 0;
  };

  template <class Command>
  void send_command(const Command& message) noexcept;
  template <class Message>
  void seal_and_transmit(Message message) noexcept;
  template <class Message>
  void accept_into(Inbox<Message>& inbox, const void* bytes, std::size_t size) noexcept;
  template <class Message>
  void file(Inbox<Message>& inbox, const Message& message) noexcept;
  template <class Message>
  DecodeStatus open(const void* bytes, std::size_t size, Message& message) const noexcept;
  template <class Message>
  void look_at_foreign(DecodeStatus status, const Message& message) noexcept;
  template <class Message>
  bool is_of_peer(Inbox<Message>& inbox, const Message& message) noexcept;
  bool is_replayed(const event_v2& event) noexcept;
  bool fits(const event_v2& event) noexcept;
  bool fits(const event_v2& event, std::int64_t newest_seq) noexcept;
  void accept_event(const void* bytes, std::size_t size) noexcept;
  bool count(DecodeStatus status) noexcept;

  Side side_;
  WireIdentity identity_;
  std::int64_t sender_;
  PeerWatch peers_;
  std::optional<std::int64_t> foreign_session_;
  LinkCounters counters_;
  std::int64_t longest_wrong_run_ = 0;
  Inbox<measurement_v3> measurement_;
  Inbox<command_v2> command_;
  Inbox<signals_measurement_v1> signals_measurement_;
  Inbox<signals_command_v1> signals_command_;
  EventQueue events_;
  std::int64_t last_command_seq_ = -1;  // sent
  std::int64_t fault_seq_ = -1;         // of the first command of the latched fault; -1: not in fault
  std::optional<MessageKey> key_;
  std::int64_t last_event_utime_ = 0;                      // sent
  std::array<std::int64_t, kSides> newest_event_utime_{};  // received, by source
  Packet packet_;
};

}  // namespace quasilpv
