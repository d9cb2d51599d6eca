// An edit from its bytes. Everything that sizes memory is checked here: counts against the bytes that are left, ids
// against the graph that the edit is for.
#include <algorithm>

#include "oriel/graph/wire.h"
#include "oriel/graph/wire_fields.h"

namespace oriel {
namespace {

using namespace wire;  // NOLINT(google-build-using-namespace): the other half of these files

// Ids beyond those that a graph holds, as far as an honest edit may reach: what was lent and never applied.
constexpr std::uint64_t kLargestLeap = 1u << 24;
constexpr std::uint64_t kLargestSerial = std::uint64_t{1} << 62;

class EditReader {
 public:
  EditReader(ByteReader& in, std::uint16_t version, const TypeList& types, const Graph& target, GraphEdit& out)
      : r_(in), version_(version), types_(types), target_(target), out_(out), leap_(kLargestLeap + in.left()) {}

  Result<void> read() {
    out_.require_version(r_.get<std::uint64_t>());
    for (std::uint32_t n = r_.get_count(1); n > 0; --n)
      if (auto ok = variables(); !ok) return ok;
    for (std::uint32_t n = r_.get_count(1); n > 0; --n)
      if (auto ok = factors(); !ok) return ok;
    if (auto ok = priors(); !ok) return ok;
    if (auto ok = labels(); !ok) return ok;
    if (!r_.at_end()) return damaged("bytes are missing or left over");
    if (added_ > 0 && largest_order_ >= added_) return damaged("the order of what is added has gaps");
    for (std::uint64_t i = 0; i < added_; ++i) out_.next_order();
    return {};
  }

 private:
  Result<void> variables() {
    auto ops = get_type(r_, types_);
    if (!ops) return ops.error();
    const VariablePool* pool = target_.find_pool((*ops)->key);
    const std::uint64_t end = pool == nullptr ? 0 : pool->slots().slot_count();
    edit::Variables& c = out_.variables(*ops);
    if (!c.empty()) return damaged("'" + std::string((*ops)->name) + "' comes twice");
    if (!added_variables(c, end)) return damaged("what it adds to '" + std::string((*ops)->name) + "' is not valid");
    for (std::uint32_t n = r_.get_count(8); n > 0; --n) {
      const SlotKey k = get_key(r_);
      if (k.index >= end) return damaged("it removes a variable that was never there");
      c.remove(k);
    }
    return settings(c);
  }

  bool added_variables(edit::Variables& c, std::uint64_t end) {
    const std::size_t bytes = c.ops->bytes;
    for (std::uint32_t n = r_.get_count(28 + bytes); n > 0; --n) {
      edit::AddedVariable a;
      a.key = get_key(r_);
      if (!number(a.serial, a.order)) return false;
      const auto flags = r_.get<std::uint32_t>();
      a.fixed = flags & kFixed;
      a.has_first_estimate = flags & kHasFirstEstimate;
      const std::byte* value = r_.get_bytes(bytes);
      const std::byte* estimate = a.has_first_estimate ? r_.get_bytes(bytes) : value;
      if ((flags & kRestricted) != 0 && !get(a.freedom)) return false;
      const bool placed = is_placeholder(a.key) || a.key.index < end + leap_;
      if (!r_.ok() || !placed) return false;
      c.add(a, value, estimate);
    }
    return r_.ok();
  }

  bool get(Freedom& freedom) {
    freedom.held = r_.get<std::uint32_t>();
    const auto axes = r_.get<std::uint8_t>();
    freedom.axes = static_cast<Freedom::Axes>(axes);
    return axes <= static_cast<std::uint8_t>(Freedom::Axes::world);
  }

  Result<void> settings(edit::Variables& c) {
    for (std::uint32_t n = r_.get_count(9 + c.ops->bytes); n > 0; --n) {
      const SlotKey k = get_key(r_);
      const auto kind = r_.get<std::uint8_t>();
      if (kind > static_cast<std::uint8_t>(edit::SetKind::first_estimate)) return damaged("an unknown kind of set");
      c.set.emplace_back(k, static_cast<edit::SetKind>(kind));
    }
    for (std::size_t i = 0; i < c.set.size(); ++i)
      if (const std::byte* value = r_.get_bytes(c.ops->bytes)) c.set_values.push_back(value);
    for (std::uint32_t n = r_.get_count(9); n > 0; --n) {
      const SlotKey k = get_key(r_);
      c.fixed.emplace_back(k, r_.get<std::uint8_t>() != 0);
    }
    for (std::uint32_t n = version_ < 3 ? 0 : r_.get_count(13); n > 0; --n) {
      const SlotKey k = get_key(r_);
      if (!get(c.freedoms.emplace_back(k, Freedom{}).second)) return damaged("axes that there are not");
    }
    return r_.ok() ? Result<void>() : damaged("it ends within a variable type");
  }

  Result<void> factors() {
    const std::string residual(r_.get_text()), noise(r_.get_text());
    const auto key = r_.get<std::uint64_t>();
    const auto measurement_bytes = r_.get<std::uint32_t>(), noise_bytes = r_.get<std::uint32_t>();
    const auto arity = r_.get<std::uint32_t>();
    if (!r_.ok()) return damaged("it ends within the name of a residual");
    const FactorOps* ops = types_.find_factor(key);
    if (ops == nullptr || ops->residual != residual || ops->noise != noise)
      return Error{ErrorCode::not_found, "message: it holds factors '" + residual + "' with " + noise +
                                             " noise, which the reader does not know"};
    if (ops->measurement_bytes != measurement_bytes || ops->noise_bytes != noise_bytes ||
        ops->variables.size() != arity)
      return damaged("'" + residual + "' has other sizes than the reader's");
    edit::Factors& c = out_.factors(ops);
    if (!c.empty()) return damaged("'" + residual + "' comes twice");
    if (rows(c)) return {};
    if (!unknown_loss_.empty())
      return Error{ErrorCode::not_found,
                   "message: it holds the loss '" + unknown_loss_ + "', which the reader does not know"};
    return damaged("what it says of '" + residual + "' is not valid");
  }

  bool rows(edit::Factors& c) {
    const std::size_t arity = c.ops->variables.size(), m = c.ops->measurement_bytes, w = c.ops->noise_bytes;
    const std::uint32_t n = r_.get_count(41 + m + w + 8 * arity);
    for (std::uint32_t i = 0; i < n; ++i) {
      edit::AddedFactor a;
      a.key = get_key(r_);
      if (!number(a.serial, a.order)) return false;
      if (!loss(a.loss)) return false;
      c.added.push_back(a);
    }
    for (std::uint32_t i = 0; i < n; ++i)
      if (const std::byte* p = r_.get_bytes(m)) c.measurements.push_back(p);
    for (std::uint32_t i = 0; i < n; ++i)
      if (const std::byte* p = r_.get_bytes(w)) c.noises.push_back(p);
    for (std::size_t i = 0; i < n * arity; ++i) c.variables.push_back(get_key(r_));
    const FactorTable* table = nullptr;
    for (const auto& t : target_.tables())
      if (t->ops().key == c.ops->key) table = t.get();
    for (std::uint32_t k = r_.get_count(8); k > 0; --k) {
      const SlotKey key = get_key(r_);
      if (table == nullptr || key.index >= table->slots().slot_count()) return false;
      c.removed_at.set(key.index, static_cast<std::uint32_t>(c.removed.size()));
      c.removed.push_back(key);
    }
    for (std::uint32_t k = r_.get_count(25); k > 0; --k) {
      auto& [key, set] = c.losses.emplace_back();
      key = get_key(r_);
      if (!loss(set)) return false;
    }
    return r_.ok();
  }

  bool loss(Loss& out) {
    const auto kind = r_.get<std::uint8_t>();
    if (kind > static_cast<std::uint8_t>(LossKind::barron)) return false;
    out.kind = static_cast<LossKind>(kind);
    out.scale = r_.get<double>();
    out.shape = r_.get<double>();
    if (out.kind != LossKind::custom) return r_.ok();
    const std::string_view name = r_.get_text();
    out.ops = types_.find_loss(name);
    if (r_.ok() && out.ops == nullptr) unknown_loss_ = name;
    return out.ops != nullptr;
  }

  Result<void> priors() {
    edit::Priors& c = out_.priors();
    for (std::uint32_t n = r_.get_count(36); n > 0; --n) {
      edit::AddedPrior a;
      a.key = get_key(r_);
      if (!number(a.serial, a.order)) return damaged("the number of a prior is not valid");
      a.variables = static_cast<std::uint32_t>(c.variables.size());
      a.block = c.numbers.size();
      a.variable_count = r_.get<std::uint32_t>();
      a.block_size = r_.get<std::uint64_t>();
      if (!r_.ok() || a.variable_count > r_.left() / 16 || a.block_size > (r_.left() - 16 * a.variable_count) / 8)
        return damaged("a prior is larger than the message");
      for (std::uint32_t k = 0; k < a.variable_count; ++k) {
        const auto type = r_.get<std::uint64_t>();
        c.variables.push_back({type, get_key(r_)});
      }
      c.numbers.resize(a.block + a.block_size);
      const std::byte* numbers = r_.get_bytes(a.block_size * sizeof(double));
      if (a.block_size > 0) std::memcpy(c.numbers.data() + a.block, numbers, a.block_size * sizeof(double));
      c.added.push_back(a);
    }
    for (std::uint32_t n = r_.get_count(8); n > 0; --n) c.removed.push_back(get_key(r_));
    return r_.ok() ? Result<void>() : damaged("it ends within the priors");
  }

  Result<void> labels() {
    for (std::uint32_t n = r_.get_count(20); n > 0; --n) {
      const auto type = r_.get<std::uint64_t>();
      const SlotKey k = get_key(r_);
      const std::string_view text = r_.get_text();
      const edit::Variables* c = out_.find_variables(type);
      if (!r_.ok() || c == nullptr || c->find_added(k) == edit::SlotMarks::kNone)
        return damaged("a label is for a variable that it does not add");
      out_.labels().emplace_back(VariableKey{type, k}, text);
    }
    return r_.ok() ? Result<void>() : damaged("it ends within the labels");
  }

  bool number(std::uint64_t& serial, std::uint64_t& order) {
    serial = r_.get<std::uint64_t>();
    order = r_.get<std::uint64_t>();
    ++added_;
    largest_order_ = std::max(largest_order_, order);
    return r_.ok() && serial < kLargestSerial;
  }

  ByteReader& r_;
  std::uint16_t version_;
  const TypeList& types_;
  const Graph& target_;
  GraphEdit& out_;
  std::string unknown_loss_;
  std::uint64_t leap_, added_ = 0, largest_order_ = 0;
};

}  // namespace

Result<void> read_edit(const Message& message, const TypeList& types, const Graph& target, GraphEdit& edit) {
  edit.clear();
  if (message.kind != kEditMessage && message.kind != kWholeMessage) return damaged("it is no edit");
  if (message.kind == kWholeMessage) edit.mark_whole();
  ByteReader r(message.payload);
  auto ok = EditReader(r, message.version, types, target, edit).read();
  if (!ok) edit.clear();
  return ok;
}

}  // namespace oriel
