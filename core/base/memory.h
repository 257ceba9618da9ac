// What the process asks of the allocator.
#pragma once

namespace strata {

// The arrays of a mesh come and go with every stage, each of another size, and the allocator keeps what is freed in pieces that fit the next
// array badly. Gives those pieces back to the system: to be called where much has been freed and much will be asked for. Does nothing where
// the C library cannot.
void return_free_memory();

}  // namespace strata
