// Alias tables: an index drawn from n weights with one lookup, whatever n (Walker 1974, "New fast method for generating
// discrete random numbers with arbitrary frequency distributions"; Vose 1991, "A linear algorithm for generating random
// numbers with a given distribution").
//
// A random float has 2^24 values, "tickets". Index i gets a whole number of them, and that number over 2^24 is its
// probability: sampling and density agree exactly, however small a weight is. The tickets are dealt to n buckets of
// (nearly) equal size; a bucket belongs to its own index up to a threshold and to one other index, the alias, from
// there.
#pragma once

#include <vector>

#include "core/rng.h"

namespace ambilux {

constexpr uint32_t kTicketBits = 24, kTickets = 1u << kTicketBits;

/// Bucket of an alias table. Tickets of the bucket below `threshold` stand for the bucket's own index.
struct alignas(8) AliasBucket {
    uint32_t threshold, alias;
};

/// Ticket of `u` in [0,1).
AMBILUX_HD uint32_t ticket_of(float u) { return uint32_t(u * float(kTickets)); }

/// Bucket, out of n, that holds a ticket: floor(ticket·n/2^24).
AMBILUX_HD uint32_t bucket_of(uint32_t ticket, uint32_t n) { return mul_hi(ticket << 8, n); }

/// Tickets of each of n <= 2^20 weights that are not negative: in proportion, at least one where the weight is
/// positive, 2^24 in all. All-zero weights count as equal ones.
std::vector<uint32_t> deal_tickets(const std::vector<double>& weights);

/// Alias table for numbers of tickets that add up to 2^24.
std::vector<AliasBucket> make_alias_table(std::vector<uint32_t> tickets);

}  // namespace ambilux
