// Settings by name, of options that are plain structs: what a config may say of whatever is chosen by name, each with
// its range, unit and a sentence. Reading, checking and printing all go by this list (io/run_config.h); the default is
// what the struct has.
//
//   struct DeckOptions { double height = 0.0, sigma = 0.1; Loss loss; };
//   const std::vector<Setting> kSettings = {
//       {"height", Real{member<&DeckOptions::height>, -10.0, 10.0}, "m", "Of the deck above the origin."},
//       {"sigma", Real{member<&DeckOptions::sigma>, 1e-6, 1e3}, "m", "Noise of the body's height above it."},
//       {"loss", Robust{member<&DeckOptions::loss>}, "sigma", "Robust loss of it."}};  // all of oriel::setting
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "oriel/base/check.h"
#include "oriel/base/owned.h"
#include "oriel/base/time.h"
#include "oriel/residual/loss.h"
#include "oriel/run/name_table.h"

namespace oriel {

namespace setting::detail {

template <class M>
struct MemberOf;
template <class O, class T>
struct MemberOf<T O::*> {
  using Options = O;
};
template <class L, class R, class O>
O options_of(R (L::*)(O&) const);
// Of a lambda that finds a setting in its options: whose options they are.
template <class F>
using OptionsOf = decltype(options_of(&F::operator()));

}  // namespace setting::detail

namespace setting {

// Bounds of what only has to be positive.
inline constexpr double kTiny = 1e-12, kHuge = 1e12;

// Where a setting is: member<&Options::sigma>, or member<&Options::limits, &Limits::least_depth>.
template <auto First, auto... Rest>
inline constexpr auto member = [
](typename detail::MemberOf<std::remove_const_t<decltype(First)>>::Options& o) -> auto& {
  return ((o.*First).*....*Rest);
};

// A T somewhere in options whose type is forgotten. Made of a lambda without captures that finds it:
// [](Options& o) -> T& { return o.x; }.
template <class T>
class Place {
 public:
  template <class F>
  requires std::is_empty_v<F>
  constexpr Place(F)  // NOLINT(google-explicit-constructor)
      : at_([](void* options) -> T& { return F{}(*static_cast<detail::OptionsOf<F>*>(options)); }) {}
  T& operator()(void* options) const { return at_(options); }

 private:
  T& (*at_)(void*);
};

// What a setting is, and where.
struct Real {
  Place<double> at;
  double least, greatest;
};
struct Whole {
  Place<int> at;
  int least, greatest;
};
struct Count {  // not negative
  static constexpr std::uint64_t kMost = std::uint64_t{1} << 40;
  Place<std::uint64_t> at;
  std::uint64_t greatest = kMost;
};
struct Seconds {
  Place<Duration> at;
  bool may_be_zero = false;
};
struct Flag {
  Place<bool> at;
};
// A robust loss, by a name of the table of losses.
struct Robust {
  Place<Loss> at;
};
// A word out of several, of an enumeration.
class Word {
 public:
  // Separated by blanks, in the order of the values.
  template <class F>
  Word(std::string_view words, F at) : Word(numbered(words), at) {}
  // Those of a table.
  template <class E, class F>
  Word(const NameTable<E>& table, F at) : Word(numbered(table), at) {}
  template <class F>
  Word(std::vector<std::pair<std::string, int>> words, F)
      : words_(std::move(words)),
        get_([](void* o) { return static_cast<int>(F{}(*static_cast<detail::OptionsOf<F>*>(o))); }),
        set_([](void* o, int value) {
          auto& word = F{}(*static_cast<detail::OptionsOf<F>*>(o));
          word = static_cast<std::remove_reference_t<decltype(word)>>(value);
        }) {}

  std::string list() const;                            // with commas
  bool set(void* options, std::string_view to) const;  // false: none of the words
  std::string get(void* options) const;

 private:
  static std::vector<std::pair<std::string, int>> numbered(std::string_view words);
  template <class E>
  static std::vector<std::pair<std::string, int>> numbered(const NameTable<E>& table) {
    std::vector<std::pair<std::string, int>> words;
    for (const auto& [name, value] : table.items()) words.emplace_back(name, static_cast<int>(value));
    return words;
  }
  std::vector<std::pair<std::string, int>> words_;
  int (*get_)(void*);
  void (*set_)(void*, int);
};
// A name out of a table's.
struct Choice {
  std::vector<std::string> names;
  Place<std::string> at;
};
// The name of a provider or a builder that the same config has; empty: the first.
struct Reference {
  enum class To { provider, builder };
  To to;
  Place<std::string> at;
};
using Kind = std::variant<Word, Real, Whole, Count, Seconds, Flag, Robust, Choice, Reference>;

}  // namespace setting

struct Setting {
  std::string name;
  setting::Kind kind;
  std::string unit;  // "-": none
  std::string sentence;
};

// Options of any type, by value.
class AnyOptions {
 public:
  AnyOptions() = default;
  template <class O>
  requires(!std::is_same_v<O, AnyOptions>) explicit AnyOptions(O options)
      : held_(new HeldOptions<O>(std::move(options))) {}
  AnyOptions(const AnyOptions& other) : held_(other.held_ ? other.held_->clone() : nullptr) {}
  AnyOptions(AnyOptions&&) noexcept = default;
  AnyOptions& operator=(AnyOptions other) noexcept {
    held_.swap(other.held_);
    return *this;
  }

  void* data() { return held_ ? held_->data() : nullptr; }  // null: of no type
  // They must be of this type.
  template <class O>
  const O& as() const {
    const auto* held = dynamic_cast<const HeldOptions<O>*>(held_.get());
    check(held != nullptr, "AnyOptions: the options are of another type");
    return held->options;
  }

 private:
  struct Held {
    virtual ~Held() = default;
    virtual Held* clone() const = 0;
    virtual void* data() = 0;
  };
  template <class O>
  struct HeldOptions final : Held {
    explicit HeldOptions(O o) : options(std::move(o)) {}
    Held* clone() const override { return new HeldOptions(options); }
    void* data() override { return &options; }
    O options;
  };
  Owned<Held> held_;
};

}  // namespace oriel
