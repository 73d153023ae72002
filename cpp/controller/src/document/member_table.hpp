// The members of a document as a table: it reads them, and it says which there are.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "document/field.hpp"

namespace quasilpv {

/// One member of a document, as its schema tells it.
struct Member {
  std::string name;
  std::string type;  ///< number, positive, polytope, object, ...
  bool optional = false;
  std::vector<Member> members = {};  ///< of an object; of each element of a list
};

/// The members of a document that become a `Struct`, in the order in which they are read. One line per member says its
/// name, its type and where it goes; whatever else stands in the document is refused. INIT-ONLY.
template <class Struct>
class MemberTable {
 public:
  /// What takes a member over. \param joints of the robot, for members whose size depends on it.
  using Read = std::function<void(const Field& member, int joints, Struct& target)>;

  /// A member that is read in its own way.
  void add(Member member, Read read) {
    members_.push_back(std::move(member));
    reads_.push_back(std::move(read));
  }

  void number(const char* name, double Struct::*at) {
    add({name, "number"}, [at](const Field& field, int /*joints*/, Struct& target) { target.*at = field.number(); });
  }
  void positive(const char* name, double Struct::*at) {
    add({name, "positive"},
        [at](const Field& field, int /*joints*/, Struct& target) { target.*at = field.positive(); });
  }
  void non_negative(const char* name, double Struct::*at) {
    add({name, "non-negative"},
        [at](const Field& field, int /*joints*/, Struct& target) { target.*at = field.non_negative(); });
  }
  void boolean(const char* name, bool Struct::*at) {
    add({name, "boolean"}, [at](const Field& field, int /*joints*/, Struct& target) { target.*at = field.boolean(); });
  }
  void text(const char* name, std::string Struct::*at) {
    add({name, "text"}, [at](const Field& field, int /*joints*/, Struct& target) { target.*at = field.text(); });
  }
  template <std::size_t Size>
  void numbers(const char* name, std::array<double, Size> Struct::*at) {
    add({name, "numbers"}, [at](const Field& field, int /*joints*/, Struct& target) {
      const std::vector<double> values = field.numbers(Size);
      std::copy(values.begin(), values.end(), (target.*at).begin());
    });
  }

  /// An object with members of its own.
  template <class Part>
  void object(const char* name, Part Struct::*at, const MemberTable<Part>& table) {
    add({name, "object", false, table.members()},
        [at, table](const Field& field, int joints, Struct& target) { table.read(field, joints, target.*at); });
  }
  /// An object that may be absent, but is not null.
  template <class Part>
  void object(const char* name, std::optional<Part> Struct::*at, const MemberTable<Part>& table) {
    add({name, "object", true, table.members()}, [at, table](const Field& field, int joints, Struct& target) {
      table.read(field, joints, (target.*at).emplace());
    });
  }
  /// A list of objects.
  template <class Part>
  void list(const char* name, std::vector<Part> Struct::*at, const MemberTable<Part>& table) {
    add({name, "list", false, table.members()}, [at, table](const Field& field, int joints, Struct& target) {
      for (std::size_t i = 0; i < field.size(); ++i) {
        table.read(field.at(i), joints, (target.*at).emplace_back());
      }
    });
  }

  /// Reads all members. \param besides names of members that are read elsewhere.
  void read(const Field& field, int joints, Struct& target, const std::vector<std::string>& besides = {}) const {
    std::vector<std::string> names = besides;
    for (const Member& member : members_) {
      names.push_back(member.name);
    }
    field.only(names);
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (!members_[i].optional || field.has(members_[i].name)) {
        reads_[i](field[members_[i].name], joints, target);
      }
    }
  }

  const std::vector<Member>& members() const noexcept { return members_; }

 private:
  std::vector<Member> members_;
  std::vector<Read> reads_;
};

}  // namespace quasilpv
