#!/bin/sh
# tests/fuzz/measurements.sh BUILD [RUNS]: every fuzz target of BUILD for RUNS inputs (1e6), from small seeds.
build=$1 runs=${2:-1000000}
seeds=$(mktemp -d)
trap 'rm -rf "$seeds"' EXIT
mkdir "$seeds/bsdf" "$seeds/csv" "$seeds/merl" "$seeds/utia" "$seeds/samples"
printf 'theta_i,phi_i,theta_o,phi_o,r,g,b\n' >"$seeds/csv/a"
for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18; do
    echo "0.$i,0,0.3,0.$i,1,2,nan" >>"$seeds/csv/a"
    echo "0.$i 1 0.2 $i 1 2 -3" >>"$seeds/csv/b"
done
python3 - "$seeds" <<'P' 2>/dev/null || true
import struct, sys
fields = []
def f(name, shape, values, dtype=10):
    fields.append((name, shape, struct.pack('<%d%s' % (len(values), 'B' if dtype == 1 else 'f'), *values), dtype))
f('phi_i', [3], [-3.2, 0, 3.2]); f('theta_i', [2], [0, 1.6]); f('ndf', [2, 2], [1, 2, 3, 4]); f('sigma', [2, 2], [1] * 4)
f('vndf', [3, 2, 2, 2], [1, 2, 1, 2] * 6); f('rgb', [3, 2, 3, 2, 2], [.1, .2, -.1, .4] * 18); f('jacobian', [1], [1], 1)
head = 18 + sum(2 + len(n) + 11 + 8 * len(s) for n, s, v, d in fields)
out, data = b'tensor_file\0' + bytes([1, 0]) + struct.pack('<I', len(fields)), b''
for n, s, v, d in fields:
    out += struct.pack('<H', len(n)) + n.encode() + struct.pack('<HBQ', len(s), d, head + len(data)) + struct.pack('<%dQ' % len(s), *s)
    data += v
open(sys.argv[1] + '/bsdf/a', 'wb').write(out + data)
open(sys.argv[1] + '/merl/a', 'wb').write(struct.pack('<3i', 90, 90, 180) + struct.pack('<4d', 1, -1, 1e5, .5))
v = [[0.6, 0, 0.8]] * 16
import json
open(sys.argv[1] + '/samples/a', 'w').write(json.dumps({'samples': {'wi': v, 'wo': v, 'fr': [[1, 2, -3]] * 16}}))
P
for name in bsdf csv merl utia samples; do
    if "$build/tests/fuzz/fuzz_$name" -runs="$runs" -max_len=4096 -verbosity=0 -print_final_stats=1 \
        "$seeds/$name" >"$seeds/log" 2>&1; then
        echo "ok fuzz/$name $(grep -o 'number_of_executed_units: .*' "$seeds/log")"
    else
        sed 's/^/  /' "$seeds/log" | tail -n 25
        echo "FAIL fuzz/$name"
    fi
done
