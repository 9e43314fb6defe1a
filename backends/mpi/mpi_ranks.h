// Ranks of MPI, an optional library.
#pragma once

namespace ambilux {

/// Joins the processes of a launcher, if one started this process; leave_mpi() at its end.
void join_mpi();
void leave_mpi();

}  // namespace ambilux
