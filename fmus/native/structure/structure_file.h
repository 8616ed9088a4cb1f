/* The modes of a structure in the file structure.bin of an FMU's resources, which a tool without arrays cannot set.
 *
 * Little-endian: the eight letters VISTRUC2, then as int64 the numbers of modes, contacts, sines, signals and rows of
 * tables. A sixth number is 1 where the damping couples the modes, else 0. The arrays of variables.toml follow as float64
 * in their order, for these numbers only.
 */
#ifndef VIBROIMPACT_STRUCTURE_FILE_H
#define VIBROIMPACT_STRUCTURE_FILE_H

#include <stdint.h>

#include "body/complaint.h"
#include "signals/table.h"
#include "sizes.h"

/* Numbers of a file: eight rows, the damping matrix, the rows of contacts, sines and signals, and tables. */
enum {
    VI_STRUCTURE_ROWS = 8,
    VI_MOST_ROWS = VI_STRUCTURE_ROWS + VI_MODES + VI_PORTS + VI_SINES + VI_SIGNALS,
    VI_MOST_NUMBERS = VI_MODES * VI_MOST_ROWS + 2 * VI_TABLE_ROOM
};

typedef struct {
    int32_t modes, contacts, sines, signals, rows, coupled; /* modes: 0 without a file; rows: of the tables */
    double numbers[VI_MOST_NUMBERS];                        /* finite */
} vi_structure_file;

/* Read the file from the folder of resources; one without modes where the folder is NULL or lacks the file. Returns
 * NULL, with the reason in `message`, for another content. The caller frees it. */
vi_structure_file *vi_structure_file_open(const char *folder, char message[VI_MESSAGE_LENGTH]);

#endif
