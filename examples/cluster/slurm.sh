#!/bin/bash
# flexviz batch over the folder fleet on 31 workers: sbatch slurm.sh; when time runs out, submit it again
#SBATCH --ntasks=33 --cpus-per-task=1 --mem-per-cpu=3G --time=08:00:00
rm -f cluster.json  # of an earlier run
srun --ntasks=1 --exact dask scheduler --scheduler-file cluster.json --port 0 --no-dashboard &
srun --ntasks=31 --exact dask worker --scheduler-file cluster.json --nthreads 1 --no-dashboard &
until [ -s cluster.json ]; do sleep 1; done
flexviz batch fleet --out RESULTS \
  --scheduler "$(python -c 'import json; print(json.load(open("cluster.json"))["address"])')"
