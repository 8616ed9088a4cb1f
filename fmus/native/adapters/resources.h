/* Data of an exported FMU in its folder of resources, in plain lines.
 *
 * sizes.txt: size of each repeated block of variables in the model description, such as `modes 8`.
 *
 * starts.txt: start values that differ from the component's, such as `17 4000000000000000`. The value reference
 * precedes the 64 bits of the number in hexadecimal digits, which every locale reads alike.
 *
 * references.txt (FMI 3.0): the component's value references of the variables of the description. The description
 * numbers its variables from 1 on in their order, as OMSimulator takes the references in dependencies for places.
 *
 * sensitivities.txt: pairs of an output and a parameter, as the component's value references, such as `30 7`. The
 * derivative of pair i is the variable with the number of the component's variables + i as the component's reference.
 */
#ifndef VIBROIMPACT_RESOURCES_H
#define VIBROIMPACT_RESOURCES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "component.h"

enum { VI_MOST_SIZES = 8, VI_BLOCK_LENGTH = 16, VI_PATH_LENGTH = 4096 }; /* most sizes; longest texts */

typedef struct {
    int count;
    struct {
        char block[VI_BLOCK_LENGTH];
        int size;
    } of[VI_MOST_SIZES];
} vi_sizes;

/* A start value: the bits of a double or of an int64_t. */
typedef struct {
    uint32_t reference;
    uint64_t bits;
} vi_start;

/* Read the sizes from the folder of resources; none when the folder is NULL or lacks the file. */
void vi_sizes_read(const char *folder, vi_sizes *sizes);

/* Read at most `most` start values, and return their number; 0 when the folder is NULL or lacks the file. */
size_t vi_starts_read(const char *folder, vi_start starts[], size_t most);

/* Read at most `most` value references of the component, and return their number; 0 without folder or file. */
size_t vi_references_read(const char *folder, uint32_t references[], size_t most);

/* Read at most `most` pairs, and return their number; 0 without folder or file. */
size_t vi_pairs_read(const char *folder, vi_derivative_pair pairs[], size_t most);

/* Open a file of the folder of resources for reading bytes; NULL when the folder is NULL or lacks the file. */
FILE *vi_resource_open(const char *folder, const char *name);

/* The folder of a URI (FMI 2.0): file:///path, file://localhost/path or file:/path, percent-encoded; NULL otherwise. */
const char *vi_folder_of_uri(const char *uri, char folder[VI_PATH_LENGTH]);

#endif
