#!/usr/bin/env python3
"""Meshes a surface step by step, each step safe to repeat: mesh_step_by_step.py ADDRESS SURFACE SPEC.json OUT.vtu

What a portal does: upload, create, watch, fetch, with a connection that may break at any moment. Needs the stubs that mesh_once.py tells how
to make.
"""
import hashlib
import pathlib
import sys
import time
import uuid

import grpc
from strata.v1 import blob_pb2, blob_pb2_grpc, job_pb2, job_pb2_grpc

FRAME_BYTES = 1 << 20
CASTAGNOLI = 0x82F63B78


def crc_table():
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (CASTAGNOLI if byte & 1 else 0)
        table.append(byte)
    return table


TABLE = crc_table()


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = TABLE[(crc ^ byte) & 0xFF] ^ crc >> 8
    return crc ^ 0xFFFFFFFF


def again(call, tries=8):
    """Calls until it works; only what says that the server is away is worth another try."""
    for left in reversed(range(tries)):
        try:
            return call()
        except grpc.RpcError as error:
            if error.code() != grpc.StatusCode.UNAVAILABLE or left == 0:
                raise
            time.sleep(0.2)


def upload(blobs, data):
    digest = hashlib.sha256(data).digest()
    started = again(lambda: blobs.StartUpload(blob_pb2.StartUploadRequest(size_bytes=len(data), sha256=digest)))
    if started.HasField("blob"):
        return started.blob.blob_id  # the server holds these bytes already

    def send():
        at = blobs.GetUpload(blob_pb2.GetUploadRequest(upload_id=started.upload_id)).committed_offset
        frames = (blob_pb2.Frame(offset=o, data=data[o:o + FRAME_BYTES], crc32c=crc32c(data[o:o + FRAME_BYTES]))
                  for o in range(at, len(data), FRAME_BYTES))
        return blobs.WriteBlob(blob_pb2.WriteBlobRequest(upload_id=started.upload_id, frame=frame) for frame in frames)
    return again(send).blob.blob_id


def watch(jobs, job_id):
    seen = 0
    while True:
        try:
            for event in jobs.WatchJob(job_pb2.WatchJobRequest(job_id=job_id, after_sequence=seen)):
                seen = max(seen, event.sequence)
                kind = event.WhichOneof("event")
                if kind == "stage_ended":
                    print(f"{job_pb2.Stage.Name(event.stage_ended.stage)}: {event.stage_ended.seconds:.2f} s")
                elif kind == "done":
                    return event.done
        except grpc.RpcError as error:
            if error.code() != grpc.StatusCode.UNAVAILABLE:
                raise
            time.sleep(0.2)  # and go on after the last event seen


def fetch(blobs, blob, out):
    data = bytearray()
    while len(data) < blob.size_bytes:
        try:
            for answer in blobs.ReadBlob(blob_pb2.ReadBlobRequest(blob_id=blob.blob_id, offset=len(data))):
                data += answer.frame.data
        except grpc.RpcError as error:
            if error.code() != grpc.StatusCode.UNAVAILABLE:
                raise
            time.sleep(0.2)
    if hashlib.sha256(data).digest() != blob.sha256:
        sys.exit("the mesh arrived damaged")
    out.write_bytes(data)


def main(address, surface, spec, out):
    options = [("grpc.max_receive_message_length", 8 << 20)]
    with grpc.insecure_channel(address, options=options) as channel:
        jobs, blobs = job_pb2_grpc.JobServiceStub(channel), blob_pb2_grpc.BlobServiceStub(channel)
        surface = pathlib.Path(surface)
        request = job_pb2.CreateJobRequest(
            request_id=str(uuid.uuid4()),  # the same id again gives the same job, not a second one
            surface=job_pb2.Surface(blob_id=upload(blobs, surface.read_bytes()), file_name=surface.name),
            spec_json=pathlib.Path(spec).read_text(),
            outputs=[job_pb2.OUTPUT_FORMAT_VTU])
        job = watch(jobs, again(lambda: jobs.CreateJob(request)).job.job_id)
        print(f"{job_pb2.JobState.Name(job.state)}: {job.hexes} hexes, scaled Jacobian at least {job.quality.all.min:.3f}")
        if job.HasField("error"):
            sys.exit(f"{job.error.reason}: {job.error.message}")
        fetch(blobs, job.artifacts[0].blob, pathlib.Path(out))


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except grpc.RpcError as error:
        sys.exit(f"{error.code().name}: {error.details()}")
