#include "oriel/graph/wire.h"

#include "oriel/base/hash.h"
#include "oriel/graph/wire_fields.h"

namespace oriel {
namespace {

using wire::damaged, wire::get_key, wire::get_type;

std::uint64_t checksum(MessageKind kind, std::span<const std::byte> payload) {
  Hash h;
  h.word(kind);
  h.bytes(payload.data(), payload.size());
  return h.value();
}

// ---- writing ----

void put_key(ByteWriter& w, SlotKey k) {
  w.put(k.index);
  w.put(k.generation);
}
void put_keys(ByteWriter& w, const std::vector<SlotKey>& keys) {
  w.put_count(keys);
  for (const SlotKey k : keys) put_key(w, k);
}
void put_column(ByteWriter& w, const ByteColumn& c) { w.put_bytes(c.data(), c.size() * c.stride()); }

void put_type(ByteWriter& w, const VariableOps& ops) {
  w.put_text(ops.name);
  w.put(ops.bytes);
  w.put(static_cast<std::uint32_t>(ops.dim));
}

void put(ByteWriter& w, const Freedom& freedom) {
  w.put(freedom.held);
  w.put(freedom.axes);
}

void put(ByteWriter& w, const edit::Variables& c) {
  put_type(w, *c.ops);
  w.put_count(c.added);
  for (std::size_t i = 0; i < c.added.size(); ++i) {
    const edit::AddedVariable& a = c.added[i];
    put_key(w, a.key);
    w.put(a.serial);
    w.put(a.order);
    w.put((a.fixed ? wire::kFixed : 0u) | (a.has_first_estimate ? wire::kHasFirstEstimate : 0u) |
          (a.freedom.is_full() ? 0u : wire::kRestricted));
    w.put_bytes(c.values.at(i), c.ops->bytes);
    if (a.has_first_estimate) w.put_bytes(c.first_estimates.at(i), c.ops->bytes);
    if (!a.freedom.is_full()) put(w, a.freedom);
  }
  put_keys(w, c.removed);
  w.put_count(c.set);
  for (const auto& [key, kind] : c.set) {
    put_key(w, key);
    w.put(kind);
  }
  put_column(w, c.set_values);
  w.put_count(c.fixed);
  for (const auto& [key, fixed] : c.fixed) {
    put_key(w, key);
    w.put(static_cast<std::uint8_t>(fixed));
  }
  w.put_count(c.freedoms);
  for (const auto& [key, freedom] : c.freedoms) {
    put_key(w, key);
    put(w, freedom);
  }
}

void put(ByteWriter& w, const Loss& loss) {
  w.put(loss.kind);
  w.put(loss.scale);
  w.put(loss.shape);
  if (loss.kind == LossKind::custom) w.put_text(loss.ops->name);
}

void put(ByteWriter& w, const edit::Factors& c) {
  w.put_text(c.ops->residual);
  w.put_text(c.ops->noise);
  w.put(c.ops->key);
  w.put(c.ops->measurement_bytes);
  w.put(c.ops->noise_bytes);
  w.put_count(c.ops->variables);
  w.put_count(c.added);
  for (const edit::AddedFactor& a : c.added) {
    put_key(w, a.key);
    w.put(a.serial);
    w.put(a.order);
    put(w, a.loss);
  }
  put_column(w, c.measurements);
  put_column(w, c.noises);
  for (const SlotKey k : c.variables) put_key(w, k);
  put_keys(w, c.removed);
  w.put_count(c.losses);
  for (const auto& [key, loss] : c.losses) {
    put_key(w, key);
    put(w, loss);
  }
}

void put(ByteWriter& w, const edit::Priors& c) {
  w.put_count(c.added);
  for (const edit::AddedPrior& a : c.added) {
    put_key(w, a.key);
    w.put(a.serial);
    w.put(a.order);
    w.put(a.variable_count);
    w.put(static_cast<std::uint64_t>(a.block_size));
    for (std::uint32_t k = 0; k < a.variable_count; ++k) {
      w.put(c.variables[a.variables + k].type);
      put_key(w, c.variables[a.variables + k].key);
    }
    w.put_bytes(c.numbers.data() + a.block, a.block_size * sizeof(double));
  }
  put_keys(w, c.removed);
}

// Only columns that say something; a reusable edit keeps many that do not.
template <class Columns>
void put_columns(ByteWriter& w, const Columns& columns) {
  std::uint32_t n = 0;
  for (const auto& c : columns) n += !c->empty();
  w.put(n);
  for (const auto& c : columns)
    if (!c->empty()) put(w, *c);
}

// Into the memory of the column that was read in its place before, if there is one.
Result<void> get_column(ByteReader& r, const TypeList& types, std::size_t place, Solution& out) {
  auto ops = get_type(r, types);
  if (!ops) return ops.error();
  if (place == out.columns.size()) out.columns.emplace_back();
  Solution::Column& c = out.columns[place];
  if (c.ops != *ops) c.values = ByteColumn((*ops)->bytes);
  c.ops = *ops;
  c.keys.clear();
  c.values.clear();
  const std::uint32_t n = r.get_count(8 + (*ops)->bytes);
  for (std::uint32_t i = 0; i < n; ++i) c.keys.push_back(get_key(r));
  for (std::uint32_t i = 0; i < n; ++i)
    if (const std::byte* p = r.get_bytes((*ops)->bytes)) c.values.push_back(p);
  return r.ok() ? Result<void>() : damaged("it ends within a solution");
}

}  // namespace

void detail::finish_message(Bytes& out, std::size_t begin, MessageKind kind) {
  const std::span<const std::byte> payload{out.data() + begin + Message::kHeaderBytes,
                                           out.size() - begin - Message::kHeaderBytes};
  const std::uint64_t size = payload.size(), sum = checksum(kind, payload);
  std::byte* at = out.data() + begin;
  auto put = [&at](const auto& x) {
    std::memcpy(at, &x, sizeof(x));
    at += sizeof(x);
  };
  put(Message::kMagic);
  put(Message::kVersion);
  put(kind);
  put(size);
  put(sum);
}

Result<MessageHeader> read_header(std::span<const std::byte> bytes) {
  ByteReader r(bytes);
  const auto magic = r.get<std::uint32_t>();
  MessageHeader h;
  h.version = r.get<std::uint16_t>();
  h.kind = r.get<MessageKind>();
  h.size = r.get<std::uint64_t>();
  h.checksum = r.get<std::uint64_t>();
  if (!r.ok()) return damaged("it is shorter than a header");
  if (magic != Message::kMagic) return damaged("it does not begin as one");
  if (h.version < Message::kOldestVersion || h.version > Message::kVersion)
    return Error{ErrorCode::bad_input, "message: it has version " + std::to_string(h.version) + ", " +
                                           std::to_string(Message::kOldestVersion) + " to " +
                                           std::to_string(Message::kVersion) + " expected"};
  return h;
}

Result<Message> read_payload(const MessageHeader& header, std::span<const std::byte> payload) {
  if (payload.size() != header.size)
    return damaged("it has " + std::to_string(payload.size()) + " bytes, " + std::to_string(header.size) + " expected");
  if (checksum(header.kind, payload) != header.checksum) return damaged("its checksum does not match");
  return Message{header.kind, payload, header.version};
}

Result<Message> read_message(std::span<const std::byte> bytes) {
  auto header = read_header(bytes);
  if (!header) return header.error();
  return read_payload(*header, bytes.subspan(Message::kHeaderBytes));
}

void append_edit(Bytes& out, const GraphEdit& edit) {
  append_message(out, edit.whole() ? kWholeMessage : kEditMessage, [&](ByteWriter& w) {
    w.put(edit.required_version());
    put_columns(w, edit.variable_columns());
    put_columns(w, edit.factor_columns());
    put(w, edit.priors());
    w.put_count(edit.labels());
    for (const auto& [id, text] : edit.labels()) {
      w.put(id.type);
      put_key(w, id.key);
      w.put_text(text);
    }
  });
}

void append_solution(Bytes& out, const Solution& solution) {
  append_message(out, kSolutionMessage, [&](ByteWriter& w) {
    w.put(solution.version);
    std::uint32_t n = 0;
    for (const auto& c : solution.columns) n += !c.keys.empty();
    w.put(n);
    for (const auto& c : solution.columns) {
      if (c.keys.empty()) continue;
      put_type(w, *c.ops);
      put_keys(w, c.keys);
      put_column(w, c.values);
    }
  });
}

// The memory of the solution that was read before is used again.
Result<void> read_solution(const Message& message, const TypeList& types, Solution& solution) {
  const auto read = [&]() -> Result<void> {
    if (message.kind != kSolutionMessage) return damaged("it is no solution");
    ByteReader r(message.payload);
    solution.version = r.get<std::uint64_t>();
    const std::uint32_t n = r.get_count(1);
    for (std::uint32_t k = 0; k < n; ++k)
      if (auto ok = get_column(r, types, k, solution); !ok) return ok;
    solution.columns.resize(n);
    return r.at_end() ? Result<void>() : damaged("bytes are missing or left over");
  };
  auto ok = read();
  if (!ok) solution = {};
  return ok;
}

}  // namespace oriel
