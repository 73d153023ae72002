// Who is speaking: which sender the other side of a run is, and what speaks against the run. A policy without a
// transport and without a clock.
#pragma once

#include <cstdint>
#include <utility>

#include "quasilpv/messages.hpp"

namespace quasilpv {

/// How a sender introduces itself in every message.
struct Speaker {
  std::int64_t sender = 0;
  Pace pace = Pace::kLockStep;
  std::int64_t period_ns = 0;
};

/// What one end of a wire noticed about who is speaking.
enum class Conflict : std::uint8_t {
  kNone,
  kSecondPlant,       ///< two plants on this session
  kSecondController,  ///< two controllers on this session
  kOtherMode,         ///< the other side runs in the other mode
  kOtherRate          ///< the other side runs at another rate
};

/// Keeps one run to its two members.
///
/// The first sender of the other side that fits is the peer. Nobody else is listened to:
/// - lock-step: a second sender is a conflict at once, because a run of two is not reproducible;
/// - real time: a second sender is a conflict as soon as the peer is heard again. Until then the peer may be dead and
///   the second one its successor, which becomes the peer once the old one was released (release()).
///
/// A twin, a sender of the own side, is a conflict before the run has begun; in a run it is nobody.
///
/// RT-SAFE (bounded, no allocation, no lock, no throw) throughout.
class PeerWatch {
 public:
  PeerWatch(Side side, Pace pace, std::int64_t period_ns) noexcept : side_(side), pace_(pace), period_ns_(period_ns) {}

  /// Name of the peer; 0: none yet.
  std::int64_t peer() const noexcept { return peer_; }
  bool has_peer() const noexcept { return has_peer_; }
  bool is_peer(std::int64_t sender) const noexcept { return has_peer_ && sender == peer_; }
  /// How often a successor became the peer.
  std::int64_t takeovers() const noexcept { return takeovers_; }

  /// A message of the other side: whether its sender is the peer, which it may become by it.
  bool hears(const Speaker& speaker) noexcept;

  /// Whether a speaker of the other side runs as this side does; a conflict if not. Operators run in no mode.
  bool fits(const Speaker& speaker) noexcept;

  /// The peer said two different things about one sample: somebody uses its name.
  void hears_contradiction() noexcept { conflict_with({peer_, pace_, period_ns_}, second_peer()); }

  /// Another one of the own side speaks, or is spoken to.
  void hears_twin(std::int64_t sender) noexcept { conflict_with({sender, pace_, period_ns_}, second_of_own()); }

  /// The peer was silent for so long that another sender may take its place.
  void release() noexcept { released_ = true; }

  /// The conflict that was noticed first since the last call.
  Conflict take_conflict() noexcept { return std::exchange(conflict_, Conflict::kNone); }
  /// The other one in the last conflict.
  const Speaker& opponent() const noexcept { return opponent_; }

 private:
  Conflict second_peer() const noexcept {
    return side_ == Side::kController ? Conflict::kSecondPlant : Conflict::kSecondController;
  }
  Conflict second_of_own() const noexcept {
    return side_ == Side::kController ? Conflict::kSecondController : Conflict::kSecondPlant;
  }
  void conflict_with(const Speaker& opponent, Conflict conflict) noexcept;

  Side side_;
  Pace pace_;
  std::int64_t period_ns_;
  bool has_peer_ = false;
  std::int64_t peer_ = 0;
  bool released_ = false;
  bool has_rival_ = false;
  Speaker rival_;
  std::int64_t takeovers_ = 0;
  Conflict conflict_ = Conflict::kNone;
  Speaker opponent_;
};

}  // namespace quasilpv
